//! Options for the creation of a plant.

use std::path::PathBuf;

use super::{Mixing, Start};
use crate::air::Air;
use crate::aircraft;
use crate::hidden::Hidden;

/// The aircraft, the air and the hidden effects of a simulation.
#[derive(Clone, Debug)]
pub struct PlantOptions {
    /// Folder that contains `NAME/NAME.xml`; `None` for an aircraft built into the program.
    pub aircraft_dir: Option<PathBuf>,
    /// Name of the aircraft: the folder and file below `aircraft_dir`, or a built-in one.
    pub aircraft: String,
    /// The properties through which the aircraft is flown.
    pub properties: Properties,
    /// Surfaces and motors with their own commands, in place of aileron, elevator and rudder; `None` if there are none.
    pub mixing: Option<Mixing>,
    /// Properties held at a value in flight, such as a flap command, by name and in JSBSim's units.
    pub held: Vec<(String, f64)>,
    /// Wind, turbulence and gusts.
    pub air: Air,
    /// Hidden effects that are written into the aircraft; without any, JSBSim loads the aircraft's file unchanged.
    pub hidden: Vec<Hidden>,
    /// Seed of the turbulence: the same seed gives the same flight.
    pub seed: u32,
    /// Geodetic latitude of the start, deg. At the default, 46.8, JSBSim's gravity minus the earth's centrifugal acceleration is
    /// 9.806 m/s² at 600 m.
    pub latitude_deg: f64,
    /// Longitude of the start, deg.
    pub longitude_deg: f64,
    /// The state at which the episodes of a simulator start.
    pub start: Start,
    /// Length of one step, s; the default is [`DT_S`](super::DT_S). JSBSim discretises the actuators' filters for the step when
    /// it loads the aircraft. Another step therefore gives a slightly different aircraft (`sitl/tests/plant/step.rs` measures the
    /// difference).
    pub step_s: f64,
}

impl Default for PlantOptions {
    fn default() -> Self {
        PlantOptions {
            aircraft_dir: None,
            aircraft: aircraft::BUILT_IN_NAME.to_owned(),
            properties: Properties::default(),
            mixing: None,
            held: Vec::new(),
            air: Air::default(),
            hidden: Vec::new(),
            seed: 1,
            latitude_deg: 46.8,
            longitude_deg: 0.0,
            start: Start::NEUTRAL,
            step_s: super::DT_S,
        }
    }
}

/// Names of the JSBSim properties through which an aircraft is flown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Properties {
    /// Property of the aileron command, −1..1.
    pub aileron_command: String,
    /// Property of the elevator command, −1..1.
    pub elevator_command: String,
    /// Property of the throttle command, 0..1.
    pub throttle_command: String,
    /// Property of the aileron position, rad. An aircraft that lacks the default property is read
    /// at `fcs/left-aileron-pos-rad`.
    pub aileron_position: String,
    /// Property of the elevator position, rad.
    pub elevator_position: String,
    /// Property of the throttle position, 0..1.
    pub throttle_position: String,
    /// Property of the rudder command, −1..1; an aircraft may lack it.
    pub rudder_command: String,
    /// Property of the rudder position, rad.
    pub rudder_position: String,
}

/// FW-JSBGym's property of the aileron position of a flying wing with two elevons.
const AILERON_POSITION: &str = "fcs/effective-aileron-pos";
/// JSBSim's standard property of the aileron position.
const LEFT_AILERON_POSITION: &str = "fcs/left-aileron-pos-rad";
/// JSBSim's standard property of the throttle command; every aircraft with an engine has it.
pub(super) const THROTTLE_COMMAND: &str = "fcs/throttle-cmd-norm";

impl Properties {
    /// The keys by which a property can be named, in the order of the fields.
    pub const KEYS: [&str; 8] = [
        "aileron_command",
        "elevator_command",
        "throttle_command",
        "aileron_position",
        "elevator_position",
        "throttle_position",
        "rudder_command",
        "rudder_position",
    ];

    /// The property name under `key`, one of [`Self::KEYS`]; `None` for any other key.
    pub fn name_mut(&mut self, key: &str) -> Option<&mut String> {
        match key {
            "aileron_command" => Some(&mut self.aileron_command),
            "elevator_command" => Some(&mut self.elevator_command),
            "throttle_command" => Some(&mut self.throttle_command),
            "aileron_position" => Some(&mut self.aileron_position),
            "elevator_position" => Some(&mut self.elevator_position),
            "throttle_position" => Some(&mut self.throttle_position),
            "rudder_command" => Some(&mut self.rudder_command),
            "rudder_position" => Some(&mut self.rudder_position),
            _ => None,
        }
    }

    /// Property of the aileron position for an aircraft that lacks the default property.
    pub(super) fn aileron_fallback(&self) -> &str {
        if self.aileron_position == AILERON_POSITION {
            LEFT_AILERON_POSITION
        } else {
            &self.aileron_position
        }
    }

    /// The property names for an aircraft with the XML text `document`.
    pub(crate) fn in_document(&self, document: &str) -> Properties {
        let mut names = self.clone();
        if !document.contains(&self.aileron_position) {
            names.aileron_position = self.aileron_fallback().to_owned();
        }
        names
    }
}

impl Default for Properties {
    fn default() -> Self {
        Properties {
            aileron_command: "fcs/aileron-cmd-norm".into(),
            elevator_command: "fcs/elevator-cmd-norm".into(),
            throttle_command: THROTTLE_COMMAND.into(),
            aileron_position: AILERON_POSITION.into(),
            elevator_position: "fcs/elevator-pos-rad".into(),
            throttle_position: "fcs/throttle-pos-norm".into(),
            rudder_command: "fcs/rudder-cmd-norm".into(),
            rudder_position: "fcs/rudder-pos-rad".into(),
        }
    }
}
