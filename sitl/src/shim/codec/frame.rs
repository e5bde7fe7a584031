//! Encodes and represents MAVLink frames: header, payload, checksum and sequence number.

use super::field::{Reader, Writer};
use super::messages::Message;

/// First byte of a MAVLink 2 frame.
pub(super) const MAGIC_2: u8 = 0xFD;
/// First byte of a MAVLink 1 frame.
pub(super) const MAGIC_1: u8 = 0xFE;

/// CRC-16/MCRF4XX over `bytes`, then over the message's CRC_EXTRA.
pub fn checksum(bytes: &[u8], crc_extra: u8) -> u16 {
    let accumulate = |crc: u16, &byte: &u8| {
        let mut x = byte ^ (crc & 0xFF) as u8;
        x ^= x << 4;
        let x = u16::from(x);
        (crc >> 8) ^ (x << 8) ^ (x << 3) ^ (x >> 4)
    };
    let crc = bytes.iter().fold(0xFFFF, accumulate);
    accumulate(crc, &crc_extra)
}

/// Version of MAVLink in which a frame was sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// MAVLink 1, magic 0xFE.
    One,
    /// MAVLink 2, magic 0xFD.
    Two,
}

/// A received frame with a valid checksum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Version of MAVLink, by the frame's magic byte.
    pub version: Version,
    /// Sequence number of the sender.
    pub sequence: u8,
    /// System ID of the sender.
    pub system: u8,
    /// Component ID of the sender.
    pub component: u8,
    /// Identifier of the message, 24 bits.
    pub id: u32,
    pub(super) length: u8,
    pub(super) payload: [u8; 255],
}

impl Frame {
    /// The payload as received; its trailing zeros may be missing.
    pub fn payload(&self) -> &[u8] {
        &self.payload[..usize::from(self.length)]
    }

    /// The decoded message; `None` if the frame contains another message than `M`.
    pub fn decode<M: Message>(&self) -> Option<M> {
        (self.id == M::ID).then(|| M::read(&mut Reader::new(self.payload())))
    }
}

/// Encodes MAVLink 2 frames for one system and component, with consecutive sequence numbers.
#[derive(Clone, Debug)]
pub struct Encoder {
    system: u8,
    component: u8,
    sequence: u8,
}

impl Encoder {
    /// An encoder whose first frame has sequence number 0.
    pub fn new(system: u8, component: u8) -> Self {
        Encoder { system, component, sequence: 0 }
    }

    /// Appends `message` as a frame to `out`.
    pub fn encode<M: Message>(&mut self, message: &M, out: &mut Vec<u8>) {
        let mut writer = Writer::default();
        message.write(&mut writer);
        let payload = writer.truncated();
        let start = out.len();
        let [id0, id1, id2, _] = M::ID.to_le_bytes();
        let (length, sequence) = (payload.len() as u8, self.sequence);
        out.extend([MAGIC_2, length, 0, 0, sequence, self.system, self.component, id0, id1, id2]);
        out.extend(payload);
        out.extend(checksum(&out[start + 1..], M::CRC_EXTRA).to_le_bytes());
        self.sequence = self.sequence.wrapping_add(1);
    }
}
