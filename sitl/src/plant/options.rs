//! What a plant is made from.

use std::path::PathBuf;

use crate::air::Air;
use crate::aircraft;
use crate::hidden::Hidden;

/// Which aircraft to fly, in what air, with what hidden in it.
#[derive(Clone, Debug)]
pub struct PlantOptions {
    /// Folder that holds `NAME/NAME.xml`; `None` is the X8 built into the program.
    pub aircraft_dir: Option<PathBuf>,
    /// The aircraft's name.
    pub aircraft: String,
    /// The properties through which the aircraft is flown.
    pub properties: Properties,
    /// Wind, turbulence, gusts.
    pub air: Air,
    /// Effects hidden in the aircraft; empty flies the aircraft's file as it is.
    pub hidden: Vec<Hidden>,
    /// Seed of the turbulence: the same seed gives the same flight.
    pub seed: u32,
    /// Geodetic latitude of the start, deg. The default, 46.8, is where JSBSim's gravity less the
    /// earth's centrifugal acceleration is 9.806 m/s² at 600 m.
    pub latitude_deg: f64,
    /// Longitude of the start, deg.
    pub longitude_deg: f64,
    /// Length of one step, s: [`DT_S`](super::DT_S) unless something else is needed. JSBSim lays
    /// out the actuators' filters for the step when it loads the aircraft, so another step is
    /// another aircraft by a little (`sitl/tests/plant_step.rs` measures it).
    pub step_s: f64,
}

impl Default for PlantOptions {
    fn default() -> Self {
        PlantOptions {
            aircraft_dir: None,
            aircraft: aircraft::BUILT_IN_NAME.to_owned(),
            properties: Properties::default(),
            air: Air::default(),
            hidden: Vec::new(),
            seed: 1,
            latitude_deg: 46.8,
            longitude_deg: 0.0,
            step_s: super::DT_S,
        }
    }
}

/// Names of the JSBSim properties through which an aircraft is flown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Properties {
    /// Aileron command, −1..1.
    pub aileron_command: String,
    /// Elevator command, −1..1.
    pub elevator_command: String,
    /// Throttle command, 0..1.
    pub throttle_command: String,
    /// Aileron position, rad.
    pub aileron_position: String,
    /// Elevator position, rad.
    pub elevator_position: String,
    /// Throttle position, 0..1.
    pub throttle_position: String,
}

impl Default for Properties {
    fn default() -> Self {
        Properties {
            aileron_command: "fcs/aileron-cmd-norm".into(),
            elevator_command: "fcs/elevator-cmd-norm".into(),
            throttle_command: "fcs/throttle-cmd-norm".into(),
            aileron_position: "fcs/effective-aileron-pos".into(),
            elevator_position: "fcs/elevator-pos-rad".into(),
            throttle_position: "fcs/throttle-pos-norm".into(),
        }
    }
}
