//! Frames to begin from, with what spoils them.

use mavlink::dialects::ardupilotmega::*;
use mavlink::{MavlinkVersion, Message};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{command, frame, raw_frame};

/// One frame of every message that the dialect knows, up to number 400, in both versions, and a
/// third as many frames of what a client really asks.
pub fn corpus() -> Vec<Vec<u8>> {
    let known = (0..400).filter_map(|id| Some((id, MavMessage::default_message_from_id(id)?)));
    let mut frames: Vec<_> = known
        .flat_map(|(id, message)| {
            let v1 = (id < 256).then(|| frame(MavlinkVersion::V1, &message));
            v1.into_iter().chain([frame(MavlinkVersion::V2, &message)])
        })
        .collect();
    for _ in 0..frames.len() / 12 {
        let setpoint =
            SET_ATTITUDE_TARGET_DATA { q: [1.0, 0.1, 0.1, 0.0], thrust: 0.5, ..Default::default() };
        frames.push(frame(MavlinkVersion::V2, &MavMessage::SET_ATTITUDE_TARGET(setpoint)));
        frames.push(command(400, &[1.0]));
        frames.push(command(511, &[30.0, 1e5]));
        let mut set = vec![0, 0, 0x20, 0x42, 1, 1];
        set.extend(*b"GL_BANK_MAX\0\0\0\0\0\x09");
        frames.push(raw_frame(23, &set));
    }
    frames
}

/// Changes a frame: payload bytes with the CRC made right again (so that it gets past the
/// parser), or any bytes, its length, or its neighbours.
pub fn mutate(rng: &mut ChaCha8Rng, bytes: &mut Vec<u8>, other: &[u8]) {
    match rng.random_range(0..6u32) {
        0..=2 => {
            let header = if bytes[0] == 0xFE { 6 } else { 10 };
            let end = bytes.len() - 2;
            for _ in 0..rng.random_range(1..12u32) {
                let at = rng.random_range(header..end.max(header + 1));
                bytes[at] = [rng.random(), 0x7F, 0xFF, 0x80, 0, 1][rng.random_range(0..6usize)];
            }
            let id = match header {
                6 => u32::from(bytes[5]),
                _ => u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]),
            };
            let crc = mavlink::calculate_crc(&bytes[1..end], MavMessage::extra_crc(id));
            bytes[end..].copy_from_slice(&crc.to_le_bytes());
        }
        3 => {
            let at = rng.random_range(0..bytes.len());
            bytes[at] ^= 1 << rng.random_range(0..8u32);
        }
        4 => bytes.truncate(rng.random_range(0..bytes.len())),
        _ => {
            let at = rng.random_range(0..=bytes.len());
            bytes.splice(at..at, other.iter().copied());
        }
    }
}
