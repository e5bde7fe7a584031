//! Events of a run against ArduPilot.

use std::fmt;
use std::net::SocketAddr;

use super::state::Home;
use crate::shim::link::Address;

/// A change of state of a run against ArduPilot.
#[derive(Clone, Debug, PartialEq)]
pub enum ArdupilotEvent {
    /// Waiting for the first servo packet.
    Waiting(Address, Home),
    /// The first servo packet of ArduPilot has arrived.
    Connected {
        /// Address from which ArduPilot sends.
        peer: SocketAddr,
        /// Channels that it sends.
        channels: usize,
        /// Steps a second that it asks for, Hz.
        asked_hz: u16,
        /// Steps a second that are made, Hz.
        made_hz: u64,
    },
    /// The frame count has gone back: the aircraft is at its start again.
    Restarted,
    /// The catapult has been released.
    Catapult,
    /// No servo packet for a second.
    Stopped,
    /// Servo packets come again after a silence.
    Resumed,
    /// A datagram that is no servo packet: from where, of how many bytes.
    Garbage(SocketAddr, usize),
    /// Servo packets come from a second sender too.
    Second(SocketAddr),
    /// ArduPilot sends fewer channels than the outputs need.
    Missing {
        /// The highest channel that moves something.
        wanted: usize,
        /// Channels that it sends.
        channels: usize,
    },
}

impl fmt::Display for ArdupilotEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ArdupilotEvent::Waiting(link, home) => write!(
                f,
                "waiting for servo packets of ArduPilot on {link}; start it: arduplane --model \
                 JSON:127.0.0.1 --home {},{},{},{}",
                home.latitude_deg, home.longitude_deg, home.altitude_m, home.heading_deg
            ),
            ArdupilotEvent::Connected { peer, channels, asked_hz, made_hz } => write!(
                f,
                "ArduPilot sends {channels} channels from {peer} and asks for {asked_hz} steps a \
                 second: {made_hz} are made"
            ),
            ArdupilotEvent::Restarted => {
                write!(f, "ArduPilot started again: the aircraft is back at its start")
            }
            ArdupilotEvent::Catapult => write!(f, "throttle above 10 %: the catapult is let go"),
            ArdupilotEvent::Stopped => write!(
                f,
                "no servo packet for 1 s: simulated time stands still until one comes; see \
                 whether ArduPilot is stopped, or start it again"
            ),
            ArdupilotEvent::Resumed => write!(f, "servo packets come again"),
            ArdupilotEvent::Garbage(from, length) => write!(
                f,
                "a datagram of {length} bytes from {from} is no servo packet and moves nothing; \
                 see which program sends to this port (ArduPilot's MAVLink has another)"
            ),
            ArdupilotEvent::Second(from) => write!(
                f,
                "servo packets from {from} too, while another ArduPilot flies: they are not \
                 answered; give each one a port of its own"
            ),
            ArdupilotEvent::Missing { wanted, channels } => write!(
                f,
                "channel {wanted} moves something and only {channels} are sent: set \
                 SERVO_32_ENABLE 1 in ArduPilot, or correct --ardupilot-outputs"
            ),
        }
    }
}
