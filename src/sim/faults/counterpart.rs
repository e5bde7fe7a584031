//! The vehicle's end of the link: the shim (the simulator's own MAVLink interface), or a simulated flight controller.

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
    /// The shim, the simulator's own MAVLink interface.
    Sitl,
    /// PX4, to which the companion commands surfaces.
    Px4,
    /// PX4, to which the companion commands attitudes.
    Px4Attitude,
    /// ArduPilot, to which the companion commands surfaces by RC channels.
    Ardupilot,
    /// ArduPilot, to which the companion commands attitudes.
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

    /// The name in tables and reports.
    pub fn name(self) -> &'static str {
        match self {
            Counterpart::Sitl => "sitl",
            Counterpart::Px4 => "px4",
            Counterpart::Px4Attitude => "px4-attitude",
            Counterpart::Ardupilot => "ardupilot",
            Counterpart::ArdupilotAttitude => "ardupilot-attitude",
        }
    }

    /// Name of the flight stack for users; `None` for the simulator.
    pub fn stack(self) -> Option<&'static str> {
        self.personality().map(|(personality, _)| match personality {
            Personality::Px4 => "PX4",
            Personality::Ardupilot => "ArduPilot",
        })
    }

    /// The flight stack's name of `mode`.
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

/// The simulated aircraft with its flight controller or shim.
pub(super) enum Aircraft {
    Sitl(Box<Bench>),
    Real(Box<FlightController>),
}

impl Aircraft {
    /// The aircraft `plant` in the scenario's wind and turbulence, with sensor noise and flight controller or shim.
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

    /// The command that reaches the actuators.
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

    /// Sets the flight controller's loiter mode, as a ground station does. Returns `false` for the shim, which has no
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

    /// Advances a step. Returns `false` when the flight has ended on the ground or with a state that is not finite.
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

    /// Whether the flight controller is in the companion's mode but holds its own attitude, because targets are
    /// missing.
    pub(super) fn turns_back(&self) -> bool {
        match self {
            Aircraft::Sitl(_) => false,
            Aircraft::Real(controller) => controller.turns_back(),
        }
    }

    /// Whether the companion has control authority.
    pub(super) fn is_steered(&self) -> bool {
        self.mode()
            .is_none_or(|mode| matches!(mode, ControllerMode::Manual | ControllerMode::Guided))
    }
}

/// The companion's link to `counterpart`.
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
