//! Flight-control section of an aircraft file exported for JSBSim, if each surface has its own command.

use std::fmt::Write;

use super::{AILERON, ELEVATOR, RUDDER, surface};
use greylag_physics::airframe::ActuatorFigures;
use greylag_physics::mixer::{CONTROLS, Does, Effector, Mixer};
use greylag_physics::servos::{Surface, Travel};

/// The surfaces of `mixer` with their travel, command property and position property. `None` if a surface lacks one of the
/// properties.
fn named(mixer: &Mixer) -> Option<Vec<(&Effector, Travel, &str, &str)>> {
    let surfaces = mixer.effectors().iter().filter_map(|e| match e.does {
        Does::Deflects(travel) => Some((e, travel)),
        Does::Pulls => None,
    });
    surfaces
        .map(|(e, travel)| Some((e, travel, e.command.as_deref()?, e.position.as_deref()?)))
        .collect()
}

/// Writes one JSBSim channel per surface, then a channel that computes the aileron, elevator and rudder deflections from the
/// surfaces. `None` if a surface lacks a property.
pub(super) fn channels(mixer: &Mixer, figures: &ActuatorFigures) -> Option<String> {
    let surfaces = named(mixer)?;
    let mut out = String::new();
    for (_, _, command, _) in &surfaces {
        let _ = writeln!(out, "    <property value=\"0\"> {command} </property>");
    }
    for (effector, travel, command, position) in &surfaces {
        let like = like(effector, figures);
        out.push_str(&surface(
            &effector.name,
            &Surface { travel: *travel, ..like },
            figures.step,
            command,
            position,
        ));
    }
    out.push_str("    <channel name=\"controls\">\n");
    let shares: Vec<[f64; 4]> = mixer.shares().collect();
    let controls = [AILERON, ELEVATOR, RUDDER];
    let count = if figures.rudder.is_some() { 3 } else { 2 };
    for (j, (control, name)) in controls.into_iter().zip(CONTROLS).take(count).enumerate() {
        let terms: String = mixer
            .effectors()
            .iter()
            .zip(&shares)
            .filter(|(e, share)| share[j] != 0.0 && e.does != Does::Pulls)
            .map(|(e, share)| {
                let position = e.position.as_deref().unwrap_or_default();
                format!(
                    " <product> <value>{:?}</value> <property>{position}</property> </product>",
                    share[j]
                )
            })
            .collect();
        let _ = writeln!(
            out,
            "      <fcs_function name=\"fcs/{name}-of-surfaces\">\n        <function> <sum> <value>0</value>{terms} </sum> \
             </function>\n        <output> {control} </output>\n      </fcs_function>"
        );
    }
    out.push_str("    </channel>\n");
    Some(out)
}

/// The actuator dynamics of the control (aileron, elevator or rudder) that moves the surface with the largest gain.
fn like(effector: &Effector, figures: &ActuatorFigures) -> Surface {
    let [aileron, elevator, rudder, _] = effector.gains.map(f64::abs);
    match figures.rudder {
        Some(of_rudder) if rudder > aileron.max(elevator) => of_rudder,
        _ if aileron > elevator => figures.aileron,
        _ => figures.elevator,
    }
}
