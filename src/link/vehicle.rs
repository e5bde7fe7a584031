//! The vehicle's side of the companion: state in, actuator commands out.
//!
//! Behind [`Vehicle`] stand the simulator's shim ([`sitl`]) and real flight controllers ([`real`]).

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

/// Standard deviation of angles of attack and sideslip by vanes, rad: customary for small aircraft.
pub const VANE_SD: f64 = 0.3 * std::f64::consts::PI / 180.0;

/// The vehicle's state at one instant, complete and in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// Moment of the measurement, vehicle clock.
    pub time: Time,
    /// How it stands to the state before it.
    pub order: Order,
    /// What is wrong with it: a part with a fault holds the last good value instead, or the
    /// neutral state's when there was none.
    pub faults: Faults,
    /// The eight variables of flight.
    pub state: State,
    /// Standard deviation of the flow angles in `state`, rad: of the angle of attack and of the sideslip alike.
    pub incidence_sd: f64,
    /// Yaw, rad.
    pub yaw: f64,
    /// Time for which a simulator holds the body rates from this instant, s; 0 where they are sampled.
    pub rate_hold_s: f64,
    /// Specific force, m/s², FRD.
    pub specific_force: [f64; 3],
    /// Actuator positions and rates.
    pub actuators: ActuatorState,
    /// Altitude above mean sea level, m.
    pub altitude: f64,
    /// Latitude and longitude, degrees, as last heard; NaN before.
    pub position: [f64; 2],
    /// Velocity over ground, NED, m/s, as last heard; NaN before.
    pub velocity: [f64; 3],
    /// Wind, NED, m/s, as last heard; NaN before.
    pub wind: [f64; 3],
}

/// How a state frame stands to the one before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The first one, or the first after the vehicle's clock started anew.
    First,
    /// Newer, with this many frames missing in between.
    Next {
        /// Frames of 10 ms that never came.
        lost: u32,
    },
    /// The same again, as a shim in lockstep repeats what was not answered: answer it again, do
    /// not act on it twice.
    Repeated,
    /// Older than one already delivered: nothing to do.
    Late,
}

/// What the pilot demands of the vehicle at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// What goes to the actuators.
    pub outputs: Outputs,
    /// Roll and pitch that are wanted, rad, for a controller that is commanded attitudes.
    pub attitude: [f64; 2],
    /// Why the aircraft should go back to its controller, if it should.
    pub fault: Option<Fault>,
}

/// What a vehicle has to tell the pilot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// A line for the ground stations.
    Text(Severity, String),
    /// The controller has given us control authority.
    Engaged,
    /// The controller was asked to take the aircraft, for this reason, and has not confirmed it.
    Released(String),
    /// The controller has the aircraft again, for this reason: engage no more until asked.
    HandedBack(String),
    /// The controller's system id, which becomes ours.
    System(u8),
}

impl Notice {
    /// What a notice that ends our steering says to the ground stations.
    pub fn ending(&self) -> Option<String> {
        match self {
            Notice::Released(reason) => {
                Some(format!("hand-back asked, not confirmed yet: {reason}"))
            }
            Notice::HandedBack(reason) => Some(format!("handed back to the controller: {reason}")),
            Notice::Text(..) | Notice::Engaged | Notice::System(_) => None,
        }
    }
}

/// A vehicle of one of the profiles.
#[expect(clippy::large_enum_variant, reason = "a program has one of them, or two")]
#[derive(Clone, Debug)]
pub enum Vehicle {
    /// The simulator's shim.
    Sitl(Sitl),
    /// A real flight controller.
    Real(Box<Real>),
}

impl Vehicle {
    /// Takes bytes from the link and delivers each state that they complete. `host` is the time
    /// since the program's start.
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

    /// The frames that answer the state of `time`; none when there is nothing to say.
    pub fn answer(&mut self, host: Duration, time: Time, demand: &Demand) -> Vec<u8> {
        match self {
            Vehicle::Sitl(sitl) => sitl.command(time, demand.outputs),
            Vehicle::Real(real) => real.answer(host, time, demand),
        }
    }

    /// What is to be sent besides answers, when something is due.
    pub fn due(&mut self, host: Duration, outputs: Outputs) -> Option<Vec<u8>> {
        match self {
            Vehicle::Sitl(sitl) => sitl.heartbeat(host, outputs),
            Vehicle::Real(real) => real.due(host),
        }
    }

    /// Whether what we command reaches the surfaces through a controller's channels, whose signs
    /// have to be found out.
    pub fn has_channels(&self) -> bool {
        match self {
            Vehicle::Sitl(_) => false,
            Vehicle::Real(real) => real.profile().authority == Authority::Surfaces,
        }
    }

    /// Whether the surfaces that are commanded are those that fly, so that a record may show them.
    pub fn flies_surfaces(&self) -> bool {
        matches!(self, Vehicle::Sitl(_)) || self.has_channels()
    }

    /// Whether the surfaces do now what they are commanded: a real controller must have been seen to give them over.
    pub fn moves_surfaces(&self) -> bool {
        match self {
            Vehicle::Sitl(_) => true,
            Vehicle::Real(real) => self.has_channels() && real.flies(),
        }
    }

    /// Why the vehicle cannot be engaged now, if it cannot.
    pub fn obstacle(&self) -> Option<String> {
        match self {
            Vehicle::Sitl(sitl) => sitl.obstacle(),
            Vehicle::Real(real) => real.obstacle(),
        }
    }

    /// The oldest notice that was not fetched.
    pub fn take_notice(&mut self) -> Option<Notice> {
        match self {
            Vehicle::Sitl(sitl) => sitl.take_notice(),
            Vehicle::Real(real) => real.take_notice(),
        }
    }

    /// Where to answer: the peer that the state comes from.
    pub fn peer(&self) -> Option<PeerId> {
        match self {
            Vehicle::Sitl(sitl) => sitl.peer(),
            Vehicle::Real(real) => real.peer(),
        }
    }

    /// What was received so far.
    pub fn counts(&self) -> VehicleCounts {
        match self {
            Vehicle::Sitl(sitl) => sitl.counts(),
            Vehicle::Real(real) => real.counts(),
        }
    }
}
