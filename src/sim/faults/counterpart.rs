//! What is at the other end of the vehicle's link: the shim, or a played flight controller.

use greylag_sitl::plant::{Inputs, PlantOptions, Truth};
use greylag_sitl::shim::bench::Bench;
use greylag_sitl::shim::controller::FlightController;
pub use greylag_sitl::shim::controller::Mode as ControllerMode;
use greylag_sitl::shim::{Distortion, Launch, Noise, Personality, ShimError, ShimOptions};

use serde::{Deserialize, Serialize};

use super::scenario::{ControllerSetting, Scenario};
use greylag_link::vehicle::{Authority, Profile, Real, Sitl, Stack, Vehicle};
use greylag_model::GreyBox;

/// What is at the other end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Counterpart {
    /// The simulator's shim.
    Sitl,
    /// PX4 by surfaces.
    Px4,
    /// PX4 by attitude.
    Px4Attitude,
    /// ArduPilot by channels.
    Ardupilot,
    /// ArduPilot by attitude.
    ArdupilotAttitude,
}

impl Counterpart {
    /// All of them.
    pub const ALL: [Counterpart; 5] = [
        Counterpart::Sitl,
        Counterpart::Px4,
        Counterpart::Px4Attitude,
        Counterpart::Ardupilot,
        Counterpart::ArdupilotAttitude,
    ];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Counterpart::Sitl => "sitl",
            Counterpart::Px4 => "px4",
            Counterpart::Px4Attitude => "px4-attitude",
            Counterpart::Ardupilot => "ardupilot",
            Counterpart::ArdupilotAttitude => "ardupilot-attitude",
        }
    }

    /// The stack of its flight controller as its users call it; `None` for the simulator, which has none.
    pub fn stack(self) -> Option<&'static str> {
        self.personality().map(|(personality, _)| match personality {
            Personality::Px4 => "PX4",
            Personality::Ardupilot => "ArduPilot",
        })
    }

    /// What its flight controller calls `mode`.
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

/// The aircraft with what flies it.
pub(super) enum Aircraft {
    Sitl(Box<Bench>),
    Real(Box<FlightController>),
}

impl Aircraft {
    /// The aircraft `plant` in the scenario's air, with its noise and its counterpart.
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
                    known: "none: no flight controller is played there".into(),
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

    /// The command that the actuators get.
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

    /// A ground station sets the flight controller's loiter mode; whether there is a flight controller.
    pub(super) fn take_over(&mut self) -> bool {
        match self {
            Aircraft::Sitl(_) => false,
            Aircraft::Real(controller) => {
                controller.set_mode(ControllerMode::Hold);
                true
            }
        }
    }

    /// Flies a step; `false` when the flight has ended on the ground or outside the numbers.
    pub(super) fn fly(&mut self) -> bool {
        let flown = match self {
            Aircraft::Sitl(bench) => bench.fly(),
            Aircraft::Real(controller) => controller.fly(),
        };
        matches!(flown, Ok(None))
    }

    /// The flight controller's mode, where there is one.
    pub(super) fn mode(&self) -> Option<ControllerMode> {
        match self {
            Aircraft::Sitl(_) => None,
            Aircraft::Real(controller) => Some(controller.mode()),
        }
    }

    /// Whether the flight controller flies by itself in the companion's mode, for want of targets.
    pub(super) fn turns_back(&self) -> bool {
        match self {
            Aircraft::Sitl(_) => false,
            Aircraft::Real(controller) => controller.turns_back(),
        }
    }

    /// Whether the companion has the surfaces, or the attitude.
    pub(super) fn is_steered(&self) -> bool {
        self.mode()
            .is_none_or(|mode| matches!(mode, ControllerMode::Manual | ControllerMode::Guided))
    }
}

/// The companion's side of the vehicle's link for `counterpart`.
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
