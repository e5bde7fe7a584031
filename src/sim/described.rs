//! Applies the surfaces, motors and conditions of an airframe file to the simulator's aircraft. Conditions are JSBSim properties
//! with constant values, such as a flap setting.

use greylag_sitl::plant::{Mixing, Moved, PlantOptions};

use greylag_physics::Airframe;
use greylag_physics::mixer::{Does, Effector};

/// Applies the surfaces, motors and conditions of `airframe` to `plant`. If no surface names a JSBSim property for its position,
/// the simulated aircraft keeps its own controls. Properties that `plant` already sets keep their values.
///
/// # Errors
///
/// If some surfaces name a property for their position and others do not. The message names a surface without such a property.
pub fn describe(plant: &mut PlantOptions, airframe: &Airframe) -> Result<(), String> {
    for (name, value) in &airframe.conditions {
        if plant.held.iter().all(|(held, _)| held != name) {
            plant.held.push((name.clone(), *value));
        }
    }
    let Some(mixer) = &airframe.mixer else { return Ok(()) };
    if mixer.effectors().iter().all(|e| e.position.is_none()) {
        return Ok(());
    }
    let moved = mixer.effectors().iter().map(|e| moved(e, plant)).collect::<Result<_, _>>()?;
    plant.mixing = Some(Mixing::new(moved)?);
    Ok(())
}

fn moved(effector: &Effector, plant: &PlantOptions) -> Result<Moved, String> {
    let Effector { name, does, gains, command, position, .. } = effector;
    let travel = match does {
        Does::Deflects(travel) => Some([travel.least, travel.most]),
        // this is the motor of an airframe file without a section [motors]
        Does::Pulls if position.is_none() && name == "throttle" => {
            return Ok(Moved::throttle(&plant.properties));
        }
        Does::Pulls => None,
    };
    let position = position.clone().ok_or_else(|| {
        format!(
            "{name} of the airframe has no position, other surfaces have one: name the JSBSim property that holds it"
        )
    })?;
    Ok(Moved { name: name.clone(), command: command.clone(), position, gains: *gains, travel })
}
