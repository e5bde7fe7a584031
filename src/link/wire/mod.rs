//! Conversion between MAVLink messages and Greylag's types. Only this module uses rust-mavlink's types.

pub mod answer;
pub mod controller;
pub mod logged;
pub mod mode;
pub mod offboard;
pub mod request;
pub mod setpoint;
pub mod sitl;
pub mod telemetry;

mod fields;

use mavlink::dialects::ardupilotmega::MavMessage;
use mavlink::{MavlinkVersion, Message as _};

use super::framing::{self, Frame, Source, Version};

/// A message that can be encoded in MAVLink 1 or 2.
#[derive(Clone, Debug)]
pub struct Message(Content);

#[derive(Clone, Debug)]
enum Content {
    /// Encoded by rust-mavlink.
    Coded(Box<MavMessage>),
    /// Encoded by hand, because rust-mavlink's enumerations cannot represent every number.
    Raw {
        id: u32,
        payload: Vec<u8>,
        /// Payload length without extension fields, bytes, for MAVLink 1.
        base: usize,
    },
}

impl Message {
    fn coded(message: MavMessage) -> Self {
        Message(Content::Coded(Box::new(message)))
    }

    fn raw(id: u32, payload: Vec<u8>, base: usize) -> Self {
        Message(Content::Raw { id, payload, base })
    }

    /// MAVLink id of the message.
    pub fn id(&self) -> u32 {
        match &self.0 {
            Content::Coded(message) => message.message_id(),
            Content::Raw { id, .. } => *id,
        }
    }

    /// The encoded frame; `None` if MAVLink 1 cannot carry the message id.
    pub fn encode(&self, version: Version, sequence: u8, source: Source) -> Option<Vec<u8>> {
        match &self.0 {
            Content::Coded(message) => {
                let mut buffer = [0; 255];
                let len = message.ser(codec_version(version), &mut buffer);
                framing::write(version, sequence, source, message.message_id(), &buffer[..len])
            }
            Content::Raw { id, payload, base } => {
                let len = if version == Version::V1 { *base } else { payload.len() };
                framing::write(version, sequence, source, *id, &payload[..len])
            }
        }
    }
}

fn codec_version(version: Version) -> MavlinkVersion {
    match version {
        Version::V1 => MavlinkVersion::V1,
        Version::V2 => MavlinkVersion::V2,
    }
}

/// Decodes a frame with rust-mavlink; `None` if an enumeration has an unknown value.
fn decode(frame: &Frame<'_>) -> Option<MavMessage> {
    MavMessage::parse(codec_version(frame.version), frame.id, frame.payload).ok()
}

/// CRC_EXTRA of a message; `None` if the message is not in the dialect.
pub fn crc_extra(id: u32) -> Option<u8> {
    match MavMessage::extra_crc(id) {
        // rust-mavlink returns 0 for unknown messages, and one known message has a CRC_EXTRA of 0.
        0 => MavMessage::default_message_from_id(id).map(|_| 0),
        extra => Some(extra),
    }
}
