//! Events of a run against ArduPilot and their texts.

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
        /// Number of channels that ArduPilot sends.
        channels: usize,
        /// Step rate that ArduPilot requests, Hz.
        asked_hz: u16,
        /// Rate of the states that the shim sends, Hz.
        made_hz: u64,
    },
    /// The frame count went back, so the aircraft was put back to its start.
    Restarted,
    /// The catapult has been released.
    Catapult,
    /// No servo packet arrived for 1 s.
    Stopped,
    /// Servo packets arrive again after an interruption.
    Resumed,
    /// A datagram that is not a servo packet: its sender and its length in bytes.
    Garbage(SocketAddr, usize),
    /// A second sender also sends servo packets.
    Second(SocketAddr),
    /// ArduPilot sends fewer channels than the outputs need.
    Missing {
        /// Highest channel that is assigned to a control.
        wanted: usize,
        /// Number of channels that ArduPilot sends.
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
