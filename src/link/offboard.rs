//! A MAVLink client that commands attitudes in OFFBOARD mode, for `greylag demo`. It talks to the server in
//! [`client`](super::client).

use super::autopilot::Mode;
use super::framing::{FrameCounts, Frames, Source, Version};
use super::wire::{Message, offboard};

pub use super::wire::offboard::Heard;

/// MAVLink ids of the autopilot: system 1, component 1.
const AUTOPILOT: Source = Source { system: 1, component: 1 };
/// MAVLink ids of this client: an onboard computer (component 191) of the same system.
const OURSELVES: Source = Source { system: 1, component: 191 };

/// Command number of MAV_CMD_COMPONENT_ARM_DISARM.
pub const ARM: u32 = 400;
/// Command number of MAV_CMD_DO_SET_MODE.
pub const SET_MODE: u32 = 176;

/// A session with one autopilot. It has no sockets and no clock.
#[derive(Clone, Debug, Default)]
pub struct OffboardClient {
    sequence: u8,
    counts: FrameCounts,
}

impl OffboardClient {
    /// Encodes a heartbeat, which is to be sent once a second.
    pub fn heartbeat(&mut self) -> Vec<u8> {
        self.frame(&offboard::heartbeat())
    }

    /// Encodes an attitude setpoint with roll and pitch in rad. `time_ms` is the time of the client's clock, ms.
    pub fn setpoint(&mut self, time_ms: u32, roll: f64, pitch: f64) -> Vec<u8> {
        self.frame(&offboard::attitude_target(AUTOPILOT, time_ms, roll, pitch))
    }

    /// Encodes the command that arms the aircraft.
    pub fn arm(&mut self) -> Vec<u8> {
        self.frame(&offboard::arm(AUTOPILOT))
    }

    /// Encodes the command that changes the mode.
    pub fn set_mode(&mut self, mode: Mode) -> Vec<u8> {
        self.frame(&offboard::set_mode(AUTOPILOT, mode))
    }

    /// Decodes a datagram and passes each message to `hear`. Frames from senders other than the autopilot are skipped.
    pub fn read(&mut self, datagram: &[u8], mut hear: impl FnMut(Heard)) {
        for frame in Frames::new(datagram, &mut self.counts) {
            if frame.source == AUTOPILOT
                && let Some(heard) = offboard::read(&frame)
            {
                hear(heard);
            }
        }
    }

    fn frame(&mut self, message: &Message) -> Vec<u8> {
        self.sequence = self.sequence.wrapping_add(1);
        message.encode(Version::V2, self.sequence, OURSELVES).unwrap_or_default()
    }
}
