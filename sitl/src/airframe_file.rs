//! Reads surfaces, motors and held conditions of the simulated aircraft from an airframe file of the companion.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::plant::{Mixing, Moved, PlantOptions};
use crate::text_file;

/// Why an airframe file cannot be used; `why` names the entry.
#[derive(Debug, thiserror::Error)]
#[error("airframe file {}: {why}", path.display())]
pub struct AirframeError {
    path: PathBuf,
    why: String,
}

#[derive(Deserialize)]
struct File {
    #[serde(default)]
    surfaces: BTreeMap<String, Effector>,
    #[serde(default)]
    motors: BTreeMap<String, Effector>,
    #[serde(default)]
    conditions: BTreeMap<String, f64>,
}

#[derive(Deserialize)]
struct Effector {
    travel_rad: Option<Number>,
    travel_min_rad: Option<Number>,
    travel_max_rad: Option<Number>,
    #[serde(default)]
    aileron: f64,
    #[serde(default)]
    elevator: f64,
    #[serde(default)]
    rudder: f64,
    #[serde(default)]
    throttle: f64,
    command: Option<String>,
    position: Option<String>,
}

#[derive(Deserialize)]
struct Number {
    value: f64,
}

impl Effector {
    fn moved(&self, name: &str, is_surface: bool) -> Result<Moved, String> {
        let position = self.position.clone().ok_or_else(|| {
            format!("{name} has no position: name the JSBSim property that holds it, as other surfaces have it")
        })?;
        let travel = match (&self.travel_rad, &self.travel_min_rad, &self.travel_max_rad) {
            _ if !is_surface => None,
            (Some(both), ..) => Some([-both.value, both.value]),
            (None, Some(least), Some(most)) => Some([least.value, most.value]),
            _ => return Err(format!("surfaces.{name} has no travel_rad")),
        };
        let moves = |[least, most]: [f64; 2]| least.is_finite() && most.is_finite() && least < most;
        if travel.is_some_and(|travel| !moves(travel)) {
            return Err(format!(
                "surfaces.{name} has a travel that is not positive; give it in rad"
            ));
        }
        let gains = [self.aileron, self.elevator, self.rudder, self.throttle];
        if !gains.iter().all(|gain| gain.is_finite()) {
            return Err(format!("{name} has a gain that is not finite"));
        }
        Ok(Moved { name: name.into(), command: self.command.clone(), position, gains, travel })
    }
}

/// Sets the mixing and the held properties of `plant` from the airframe file at `path`. If no entry of the file has a `position`,
/// the plant keeps the control channels of the JSBSim aircraft.
///
/// # Errors
/// If the file cannot be read or parsed, a surface has no travel, an entry has no position, or the mixing is invalid.
pub fn apply(path: &Path, plant: &mut PlantOptions) -> Result<(), AirframeError> {
    let fail = |why: String| AirframeError { path: path.to_owned(), why };
    let text = text_file::read(path).map_err(fail)?;
    let file: File = toml::from_str(&text).map_err(|e| fail(e.message().to_owned()))?;
    for (name, value) in file.conditions {
        // a value that is already held comes from the command line, which takes precedence
        if !plant.held.iter().any(|(held, _)| *held == name) {
            plant.held.push((name, value));
        }
    }
    let all = || file.surfaces.values().chain(file.motors.values());
    if all().all(|e| e.position.is_none()) {
        return Ok(());
    }
    let surfaces = file.surfaces.iter().map(|(name, e)| e.moved(name, true));
    let motors = file.motors.iter().map(|(name, e)| e.moved(name, false));
    let mut moved = surfaces.chain(motors).collect::<Result<Vec<_>, _>>().map_err(fail)?;
    if file.motors.is_empty() {
        moved.push(Moved::throttle(&plant.properties));
    }
    plant.mixing = Some(Mixing::new(moved).map_err(fail)?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The message for an airframe with two elevons of this travel and this aileron gain; empty if it is accepted.
    fn refusal(travel: &str, aileron: &str) -> String {
        let elevon = |name: &str, sign: &str| {
            format!(
                "[surfaces.{name}]\nposition = \"fcs/{name}\"\nelevator = 1.0\naileron = {sign}{aileron}\n\
                 travel_rad = {{ value = {travel} }}\n"
            )
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("airframe.toml");
        std::fs::write(&path, elevon("left", "") + &elevon("right", "-")).unwrap();
        let applied = apply(&path, &mut PlantOptions::default());
        applied.map_or_else(|e| e.to_string(), |()| String::new())
    }

    #[test]
    fn the_command_line_takes_precedence_over_a_condition() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("airframe.toml");
        std::fs::write(&path, "[conditions]\n\"fcs/flap\" = 1.0\n\"fcs/gear\" = 0.0\n").unwrap();
        let held = vec![("fcs/flap".to_owned(), 0.5)];
        let mut plant = PlantOptions { held, ..PlantOptions::default() };
        apply(&path, &mut plant).unwrap();
        assert_eq!(plant.held, [("fcs/flap".to_owned(), 0.5), ("fcs/gear".to_owned(), 0.0)]);
    }

    #[test]
    fn a_surface_without_travel_or_with_a_gain_that_is_no_number_is_refused() {
        assert_eq!(refusal("0.5", "1.0"), "");
        assert!(refusal("0.0", "1.0").contains("surfaces.left has a travel"));
        assert!(refusal("nan", "1.0").contains("surfaces.left has a travel"));
        assert!(refusal("0.5", "nan").contains("left has a gain"));
    }
}
