//! The vehicle at the other end of the companion's link in a simulated flight with faults. It is a simulated aircraft with a
//! simulated flight controller, or with the shim, the simulator's own MAVLink interface.

use greylag_sitl::plant::{Inputs, PlantOptions, Truth};
use greylag_sitl::shim::bench::Bench;
use greylag_sitl::shim::controller::FlightController;
pub use greylag_sitl::shim::controller::Mode as ControllerMode;
use greylag_sitl::shim::{Distortion, Launch, Noise, Personality, ShimError, ShimOptions};

use serde::{Deserialize, Serialize};

use super::scenario::{ControllerSetting, Scenario};
use greylag_link::vehicle::{Authority, Profile, Real, Sitl, Stack, Vehicle};
use greylag_model::GreyBox;

/// Kind of vehicle at the other end of the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Counterpart {
    /// The shim, to which the companion sends surface commands.
    Sitl,
    /// A simulated PX4, to which the companion sends surface commands.
    Px4,
    /// A simulated PX4, to which the companion sends attitudes.
    Px4Attitude,
    /// A simulated ArduPilot, to which the companion sends surface commands as RC channels.
    Ardupilot,
    /// A simulated ArduPilot, to which the companion sends attitudes.
    ArdupilotAttitude,
}

impl Counterpart {
    /// Every kind of vehicle.
    pub const ALL: [Counterpart; 5] = [
        Counterpart::Sitl,
        Counterpart::Px4,
        Counterpart::Px4Attitude,
        Counterpart::Ardupilot,
        Counterpart::ArdupilotAttitude,
    ];

    /// The name of the kind in tables and reports.
    pub fn name(self) -> &'static str {
        match self {
            Counterpart::Sitl => "sitl",
            Counterpart::Px4 => "px4",
            Counterpart::Px4Attitude => "px4-attitude",
            Counterpart::Ardupilot => "ardupilot",
            Counterpart::ArdupilotAttitude => "ardupilot-attitude",
        }
    }

    /// Name of the flight controller's software for users; `None` for the shim.
    pub fn stack(self) -> Option<&'static str> {
        self.personality().map(|(personality, _)| match personality {
            Personality::Px4 => "PX4",
            Personality::Ardupilot => "ArduPilot",
        })
    }

    /// The name that the flight controller's software gives to `mode`.
    pub fn mode_name(self, mode: ControllerMode) -> &'static str {
        let px4 = matches!(self, Counterpart::Px4 | Counterpart::Px4Attitude);
        match mode {
            ControllerMode::Manual => "MANUAL",
            ControllerMode::Guided if px4 => "OFFBOARD",
            ControllerMode::Guided => "GUIDED",
            ControllerMode::Hold if px4 => "HOLD",
            ControllerMode::Hold => "LOITER",
            ControllerMode::Return => "RTL",
            ControllerMode::Circle => "CIRCLE",
        }
    }

    fn personality(self) -> Option<(Personality, Authority)> {
        match self {
            Counterpart::Sitl => None,
            Counterpart::Px4 => Some((Personality::Px4, Authority::Surfaces)),
            Counterpart::Px4Attitude => Some((Personality::Px4, Authority::Attitude)),
            Counterpart::Ardupilot => Some((Personality::Ardupilot, Authority::Surfaces)),
            Counterpart::ArdupilotAttitude => Some((Personality::Ardupilot, Authority::Attitude)),
        }
    }
}

/// The simulated aircraft with its flight controller or with the shim.
pub(super) enum Aircraft {
    Sitl(Box<Bench>),
    Real(Box<FlightController>),
}

impl Aircraft {
    /// The aircraft `plant` in the scenario's wind and turbulence, with sensor noise, and with the scenario's flight controller
    /// or the shim.
    pub(super) fn new(plant: &PlantOptions, scenario: &Scenario) -> Result<Self, ShimError> {
        let mut options = ShimOptions::new(scenario.air(plant), plant.start);
        options.seed = scenario.seed;
        options.noise = Noise::REALISTIC;
        let first = scenario.controller_parameters.first();
        Ok(match (scenario.counterpart.personality(), first) {
            (None, Some(setting)) => {
                return Err(ShimError::Parameter {
                    stack: "sitl",
                    name: setting.name.clone(),
                    known: "none: no flight controller is simulated there".into(),
                });
            }
            (None, None) => Aircraft::Sitl(Box::new(Bench::new(&options)?)),
            (Some((personality, _)), _) => {
                options.launch = Launch::Immediate;
                let set = |s: &ControllerSetting| (s.name.clone(), s.value);
                options.parameters = scenario.controller_parameters.iter().map(set).collect();
                Aircraft::Real(Box::new(FlightController::new(personality, &options)?))
            }
        })
    }

    pub(super) fn show(&mut self, distortion: Distortion) -> Vec<u8> {
        let mut bytes = Vec::new();
        match self {
            Aircraft::Sitl(bench) => {
                bench.distort(distortion);
                bench.show(&mut bytes);
            }
            Aircraft::Real(controller) => {
                controller.distort(distortion);
                controller.show(&mut bytes);
            }
        }
        bytes
    }

    pub(super) fn truth(&self) -> Truth {
        match self {
            Aircraft::Sitl(bench) => bench.measured(),
            Aircraft::Real(controller) => controller.measured(),
        }
    }

    /// The commands that reach the actuators.
    pub(super) fn inputs(&self) -> Inputs {
        match self {
            Aircraft::Sitl(bench) => bench.inputs(),
            Aircraft::Real(controller) => controller.inputs(),
        }
    }

    pub(super) fn hear(&mut self, bytes: &[u8]) {
        match self {
            Aircraft::Sitl(bench) => bench.receive(bytes),
            Aircraft::Real(controller) => controller.receive(bytes),
        }
    }

    /// Changes the flight controller to its hold mode, as a ground station would. Returns `false` for the shim, which has no
    /// modes.
    pub(super) fn take_over(&mut self) -> bool {
        match self {
            Aircraft::Sitl(_) => false,
            Aircraft::Real(controller) => {
                controller.set_mode(ControllerMode::Hold);
                true
            }
        }
    }

    /// Simulates one step. Returns `false` if the flight has ended, because the aircraft hit the ground or its state is not
    /// finite.
    pub(super) fn fly(&mut self) -> bool {
        let flown = match self {
            Aircraft::Sitl(bench) => bench.fly(),
            Aircraft::Real(controller) => controller.fly(),
        };
        matches!(flown, Ok(None))
    }

    /// The flight controller's mode; `None` for the shim.
    pub(super) fn mode(&self) -> Option<ControllerMode> {
        match self {
            Aircraft::Sitl(_) => None,
            Aircraft::Real(controller) => Some(controller.mode()),
        }
    }

    /// Whether ArduPilot is in GUIDED but has received no valid target recently. It then flies back to the place where GUIDED
    /// began.
    pub(super) fn turns_back(&self) -> bool {
        match self {
            Aircraft::Sitl(_) => false,
            Aircraft::Real(controller) => controller.turns_back(),
        }
    }

    /// Whether the vehicle executes the companion's commands. A flight controller does so in MANUAL and in OFFBOARD or GUIDED;
    /// the shim always does.
    pub(super) fn is_steered(&self) -> bool {
        self.mode()
            .is_none_or(|mode| matches!(mode, ControllerMode::Manual | ControllerMode::Guided))
    }
}

/// The companion's side of the link to `counterpart`.
pub(super) fn vehicle(counterpart: Counterpart, model: &GreyBox) -> Vehicle {
    let actuators = model.airframe.actuators;
    match counterpart.personality() {
        None => Vehicle::Sitl(Sitl::new(1, actuators.travels())),
        Some((personality, authority)) => {
            let stack = match personality {
                Personality::Px4 => Stack::Px4,
                Personality::Ardupilot => Stack::Ardupilot,
            };
            Vehicle::Real(Box::new(Real::new(Profile { stack, authority, actuators })))
        }
    }
}
