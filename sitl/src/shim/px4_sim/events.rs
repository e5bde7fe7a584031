//! Events of a run against PX4 and their texts.

use std::fmt;
use std::net::SocketAddr;

use crate::shim::link::Address;

/// A change of state of a run against PX4.
#[derive(Clone, Debug, PartialEq)]
pub enum Px4Event {
    /// The simulator listens, but no client is connected.
    Waiting(Address),
    /// A client has connected.
    Connected(SocketAddr),
    /// The client has closed its connection, so the aircraft was put back to its start.
    Gone,
    /// The client runs in lockstep: each step waits for its answer, for at most 3 s.
    Lockstep,
    /// The client's time stamps are from an unrelated clock, so each message counts as an answer to the latest step.
    ForeignClock,
    /// The catapult has been released.
    Catapult,
    /// Lockstep: no answer arrived for 1 s. Until an answer arrives, a step is made every 3 s.
    Stopped,
    /// Lockstep: an answer has arrived after the interruption.
    Resumed,
    /// Real time: no actuator message arrived for 1 s; the last outputs hold.
    Silent,
    /// Real time: actuator messages arrive again.
    SilenceEnded,
    /// The client is not usable as PX4; the text gives the reason and the remedy.
    Refused(&'static str),
}

impl fmt::Display for Px4Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Px4Event::Waiting(link) => write!(
                f,
                "waiting for PX4 on {link}; start it in its source folder: PX4_SYS_AUTOSTART=1036 \
                 PX4_SIM_MODEL=jsbsim_malolo build/px4_sitl_default/bin/px4"
            ),
            Px4Event::Connected(peer) => write!(f, "PX4 connected from {peer}"),
            Px4Event::Gone => write!(f, "PX4 gone: the aircraft is back at its start"),
            Px4Event::Lockstep => write!(f, "lockstep: a step is made on PX4's answer"),
            Px4Event::ForeignClock => write!(
                f,
                "the actuator messages show another clock: they are counted as answers, whatever \
                 their time"
            ),
            Px4Event::Catapult => write!(f, "armed with throttle: the catapult is let go"),
            Px4Event::Stopped => write!(
                f,
                "no actuator message for 1 s: until one comes a step is made every 3 s; see \
                 whether PX4 is stopped, or end it and start it again"
            ),
            Px4Event::Resumed => write!(f, "answered: simulated time goes on"),
            Px4Event::Silent => write!(
                f,
                "no actuator message for 1 s: the outputs stay as they are; see whether PX4 is \
                 stopped"
            ),
            Px4Event::SilenceEnded => write!(f, "actuator messages come again"),
            Px4Event::Refused(why) => write!(f, "{why}"),
        }
    }
}
