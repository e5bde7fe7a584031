//! The only module that uses rust-mavlink's message types; all others use this project's.

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

/// A message to be encoded in either version for any peer.
#[derive(Clone, Debug)]
pub struct Message(Content);

#[derive(Clone, Debug)]
enum Content {
    /// Encoded by the codec.
    Coded(Box<MavMessage>),
    /// Encoded by hand, because the codec's enumerations cannot carry every number.
    Raw {
        id: u32,
        payload: Vec<u8>,
        /// The length without extension fields, for MAVLink 1.
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

    /// Message id.
    pub fn id(&self) -> u32 {
        match &self.0 {
            Content::Coded(message) => message.message_id(),
            Content::Raw { id, .. } => *id,
        }
    }

    /// The encoded frame; `None` when MAVLink 1 cannot carry the message id.
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

/// Decodes a frame by the codec; `None` when an enumeration holds an unknown number.
fn decode(frame: &Frame<'_>) -> Option<MavMessage> {
    MavMessage::parse(codec_version(frame.version), frame.id, frame.payload).ok()
}

/// CRC_EXTRA of a message; `None` outside the dialect.
pub fn crc_extra(id: u32) -> Option<u8> {
    match MavMessage::extra_crc(id) {
        // The codec answers 0 for what it does not know, and one known message has 0 too.
        0 => MavMessage::default_message_from_id(id).map(|_| 0),
        extra => Some(extra),
    }
}
