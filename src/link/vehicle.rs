//! The vehicle link, which receives state frames and sends actuator commands.
//!
//! [`Vehicle`] is either the simulator's MAVLink side, called shim ([`sitl`]), or a real flight controller ([`real`]).

mod fault;
pub mod limits;
pub mod real;
pub mod sitl;

use std::time::Duration;

use super::autopilot::Severity;
use super::peer::PeerId;
pub use fault::{Axis, Fault};
use greylag_physics::{ActuatorState, State, Time};
pub use limits::Faults;
pub use real::Real;
pub use real::profile::{Authority, Profile, Stack};
pub use sitl::{Sitl, VehicleCounts};

pub use super::wire::sitl::Outputs;

/// Standard deviations of angle of attack and sideslip as measured by vanes on small aircraft, rad.
pub const VANE_SD: [f64; 2] = [0.3 * std::f64::consts::PI / 180.0; 2];

/// The vehicle's state at one instant, complete and in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// Vehicle time of the measurement.
    pub time: Time,
    /// Order relative to the previous state frame.
    pub order: Order,
    /// Invalid parts of the state. Such a part keeps its last valid value. Before the first valid value it has a
    /// neutral value.
    pub faults: Faults,
    /// The eight state variables: airspeed, flow angles, roll, pitch and body rates.
    pub state: State,
    /// Standard deviations of the angle of attack and the sideslip in `state`, rad.
    pub incidence_sd: [f64; 2],
    /// Yaw angle ψ, rad.
    pub yaw: f64,
    /// Time for which the source holds the body rates constant, s. A simulator holds them for one step. 0 means that the
    /// rates were sampled at this instant.
    pub rate_hold_s: f64,
    /// Specific force along body x, y, z (forward, right, down), m/s².
    pub specific_force: [f64; 3],
    /// Actuator positions and rates: surfaces in rad and rad/s, throttle 0..1.
    pub actuators: ActuatorState,
    /// Altitude above mean sea level, m.
    pub altitude: f64,
    /// Latitude and longitude last received, degrees; NaN before the first position.
    pub position: [f64; 2],
    /// Velocity over ground last received, NED, m/s; NaN before the first velocity.
    pub velocity: [f64; 3],
    /// Wind velocity last received, NED, m/s; NaN before the first wind.
    pub wind: [f64; 3],
}

/// Order of a state frame relative to the previous one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The first frame, or the first after a restart of the vehicle's clock.
    First,
    /// A newer frame.
    Next {
        /// Number of 10 ms frames lost before it.
        lost: u32,
    },
    /// The previous frame again. A simulator in lockstep repeats a frame until it gets a reply. The frame needs a reply
    /// but must not be processed again.
    Repeated,
    /// A frame older than the newest delivered frame. It must be ignored.
    Late,
}

/// The companion's demand on the vehicle at one control tick (10 ms).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Commanded actuator outputs.
    pub outputs: Outputs,
    /// Commanded roll and pitch, rad, for a flight controller that receives attitude setpoints.
    pub attitude: [f64; 2],
    /// Fault for which control authority is returned; `None` to keep control authority.
    pub fault: Option<Fault>,
}

/// A notice from the vehicle link to the companion's pilot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// A text for the ground stations.
    Text(Severity, String),
    /// The flight controller has given control authority.
    Engaged,
    /// Return of control authority was requested for this reason and is not confirmed yet.
    Released(String),
    /// The flight controller has control again, for this reason. The companion must not engage again without a command.
    HandedBack(String),
    /// System id of the flight controller, which the companion adopts as its own.
    System(u8),
}

impl Notice {
    /// The text for the ground stations, if the notice ends the companion's control; otherwise `None`.
    pub fn ending(&self) -> Option<String> {
        match self {
            Notice::Released(reason) => {
                Some(format!("hand-back requested, not confirmed yet: {reason}"))
            }
            Notice::HandedBack(reason) => Some(format!("handed back to the controller: {reason}")),
            Notice::Text(..) | Notice::Engaged | Notice::System(_) => None,
        }
    }
}

/// The link to the simulator or to a flight controller.
#[expect(clippy::large_enum_variant, reason = "a program has one of them, or two")]
#[derive(Clone, Debug)]
pub enum Vehicle {
    /// The shim of the simulator.
    Sitl(Sitl),
    /// A real flight controller.
    Real(Box<Real>),
}

impl Vehicle {
    /// Handles bytes from the link and delivers each completed state. `host` is the time since the program's start.
    pub fn handle(
        &mut self,
        host: Duration,
        peer: PeerId,
        bytes: &[u8],
        deliver: impl FnMut(Telemetry),
    ) {
        match self {
            Vehicle::Sitl(sitl) => sitl.handle(host, peer, bytes, deliver),
            Vehicle::Real(real) => real.handle(host, peer, bytes, deliver),
        }
    }

    /// The frames that reply to the state of vehicle time `time`; empty if none are due.
    pub fn answer(&mut self, host: Duration, time: Time, demand: &Demand) -> Vec<u8> {
        match self {
            Vehicle::Sitl(sitl) => sitl.command(time, demand.outputs),
            Vehicle::Real(real) => real.answer(host, time, demand),
        }
    }

    /// Frames other than replies that are due at `host`; `None` without such frames.
    pub fn due(&mut self, host: Duration, outputs: Outputs) -> Option<Vec<u8>> {
        match self {
            Vehicle::Sitl(sitl) => sitl.heartbeat(host, outputs),
            Vehicle::Real(real) => real.due(host),
        }
    }

    /// Excludes `missed`, the length of a stall of this computer, from all timeouts: frames sent during the stall may
    /// still be in the receive buffer.
    pub fn excuse(&mut self, missed: Duration) {
        match self {
            Vehicle::Sitl(_) => {}
            Vehicle::Real(real) => real.excuse(missed),
        }
    }

    /// Whether the commands are surface deflections that pass through a flight controller. Their signs must then be
    /// checked.
    pub fn has_channels(&self) -> bool {
        match self {
            Vehicle::Sitl(_) => false,
            Vehicle::Real(real) => real.profile().authority == Authority::Surfaces,
        }
    }

    /// Whether the companion commands the surfaces directly. A recording may then contain the commands as deflections.
    pub fn flies_surfaces(&self) -> bool {
        matches!(self, Vehicle::Sitl(_)) || self.has_channels()
    }

    /// Whether the surfaces follow the commands now. With a flight controller, its reported mode must confirm it.
    pub fn moves_surfaces(&self) -> bool {
        match self {
            Vehicle::Sitl(_) => true,
            Vehicle::Real(real) => self.has_channels() && real.flies(),
        }
    }

    /// Reason why the vehicle cannot be engaged now; `None` if it can be.
    pub fn obstacle(&self) -> Option<String> {
        match self {
            Vehicle::Sitl(sitl) => sitl.obstacle(),
            Vehicle::Real(real) => real.obstacle(),
        }
    }

    /// Removes and returns the oldest notice.
    pub fn take_notice(&mut self) -> Option<Notice> {
        match self {
            Vehicle::Sitl(sitl) => sitl.take_notice(),
            Vehicle::Real(real) => real.take_notice(),
        }
    }

    /// The peer from which the states are received; `None` before the first frame.
    pub fn peer(&self) -> Option<PeerId> {
        match self {
            Vehicle::Sitl(sitl) => sitl.peer(),
            Vehicle::Real(real) => real.peer(),
        }
    }

    /// Traffic counters since the start.
    pub fn counts(&self) -> VehicleCounts {
        match self {
            Vehicle::Sitl(sitl) => sitl.counts(),
            Vehicle::Real(real) => real.counts(),
        }
    }
}
