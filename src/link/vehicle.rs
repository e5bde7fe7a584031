//! The vehicle's side of the companion: state in, actuator commands out.
//!
//! There is one struct per vehicle profile behind [`Vehicle`]; `px4` and `ardupilot` will stand
//! beside [`sitl`].

pub mod limits;
pub mod sitl;

use std::time::Duration;

use super::peer::PeerId;
use crate::physics::{ActuatorState, State, Time};
pub use limits::Faults;
pub use sitl::{Sitl, VehicleCounts};

pub use super::wire::sitl::Outputs;

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
    /// Yaw, rad.
    pub yaw: f64,
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

/// A vehicle of one of the profiles.
// One variant today; `px4` and `ardupilot` come with the real flight controllers.
#[derive(Clone, Debug)]
pub enum Vehicle {
    /// The simulator's shim.
    Sitl(Sitl),
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
        }
    }

    /// The frame that answers the state of `time`.
    pub fn command(&mut self, time: Time, outputs: Outputs) -> Vec<u8> {
        match self {
            Vehicle::Sitl(sitl) => sitl.command(time, outputs),
        }
    }

    /// The heartbeat, when one is due.
    pub fn heartbeat(&mut self, host: Duration, outputs: Outputs) -> Option<Vec<u8>> {
        match self {
            Vehicle::Sitl(sitl) => sitl.heartbeat(host, outputs),
        }
    }

    /// Where to answer: the peer that the state comes from.
    pub fn peer(&self) -> Option<PeerId> {
        match self {
            Vehicle::Sitl(sitl) => sitl.peer(),
        }
    }

    /// What was received so far.
    pub fn counts(&self) -> VehicleCounts {
        match self {
            Vehicle::Sitl(sitl) => sitl.counts(),
        }
    }
}
