//! MAVLink 2 message signing: signs outgoing frames and verifies received frames.
//!
//! According to the MAVLink guide, the signature is the first 48 bits of the SHA-256 of key, frame, link id and
//! timestamp. A stream is all frames with the same system id, component id and link id. Timestamps (units of 10 µs since
//! 2015) must increase from frame to frame of a stream. The signing of the crate `mavlink` is not used, because its
//! timestamp cannot be read and stored for the next start.

mod key;
mod stamp;

use std::collections::HashMap;

use mavlink::calculate_crc;
use sha2::{Digest, Sha256};

use super::framing::{Source, pieces};
pub use key::{Key, KeyError};
pub use stamp::{StampError, StampFile};

/// Start marker of MAVLink 2.
const STX: u8 = 0xFD;
/// Incompatibility flag of a signed frame.
const FLAG_SIGNED: u8 = 0x01;
/// Lengths of header, checksum and signature block of MAVLink 2, bytes.
const HEADER: usize = 10;
const CHECKSUM: usize = 2;
const BLOCK: usize = 13;
/// Length of the signature field in bytes.
const SIGNATURE: usize = 6;
/// The first timestamp of a new stream may be at most this much older than the newest timestamp of all: 1 min, in units of
/// 10 µs.
const MINUTE: u64 = 6_000_000;
/// Largest number of streams that are accepted. Only a holder of the key can add a stream.
const MAX_STREAMS: usize = 1024;
/// Largest timestamp, which has 48 bits.
const STAMP_MAX: u64 = (1 << 48) - 1;
/// 1 January 2015 in µs since 1970.
const EPOCH_US: u64 = 1_420_070_400_000_000;

/// The signing timestamp of a Unix time: units of 10 µs since 1 January 2015.
pub fn stamp_of(unix_us: u64) -> u64 {
    (unix_us.saturating_sub(EPOCH_US) / 10).min(STAMP_MAX)
}

/// Counters of signed and verified frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SigningCounts {
    /// Frames signed by this program.
    pub signed: u64,
    /// Received frames with a valid signature.
    pub believed: u64,
    /// Received frames without a signature, which were refused.
    pub unsigned: u64,
    /// Received frames with an invalid signature (another key or modified content), which were refused.
    pub forged: u64,
    /// Received frames that were refused for their timestamp: not newer than the last of their stream, or more than a
    /// minute old in a new stream. Also frames of new streams beyond the largest number of streams.
    pub replayed: u64,
    /// MAVLink 1 frames that were not sent, because they cannot be signed.
    pub unsignable: u64,
}

impl SigningCounts {
    /// Total number of refused frames.
    pub fn refused(&self) -> u64 {
        self.unsigned + self.forged + self.replayed
    }
}

/// A signing key with the timestamps of all streams.
#[derive(Debug)]
pub struct Signer {
    key: Key,
    /// The newest timestamp of the clock or of any frame, sent or received, in units of 10 µs since 2015.
    stamp: u64,
    streams: HashMap<(u8, Source), u64>,
    counts: SigningCounts,
}

impl Signer {
    /// A signer with `key` that continues from the timestamp `stamp`.
    pub fn new(key: Key, stamp: u64) -> Self {
        Signer { key, stamp, streams: HashMap::new(), counts: SigningCounts::default() }
    }

    /// The newest timestamp in units of 10 µs since 2015, to be stored for the next start.
    pub fn stamp(&self) -> u64 {
        self.stamp
    }

    /// Counters since the start.
    pub fn counts(&self) -> SigningCounts {
        self.counts
    }

    /// Returns the frames of `bytes`, signed with the link id `link` at the time `unix_us` (µs since 1970). A frame that already
    /// has a signature stays unmodified. A MAVLink 1 frame is dropped.
    pub fn sign(&mut self, unix_us: u64, link: u8, bytes: &[u8]) -> Vec<u8> {
        let mut signed = Vec::with_capacity(bytes.len() + BLOCK);
        pieces(bytes, |frame, _| match (frame[0] == STX, frame[2] & FLAG_SIGNED != 0) {
            (false, _) => self.counts.unsignable += 1,
            (true, true) => signed.extend_from_slice(frame),
            (true, false) => self.put(unix_us, link, frame, &mut signed),
        });
        signed
    }

    /// Signs an unsigned MAVLink 2 frame and appends it to `out`.
    fn put(&mut self, unix_us: u64, link: u8, frame: &[u8], out: &mut Vec<u8>) {
        self.stamp = (self.stamp + 1).max(stamp_of(unix_us)).min(STAMP_MAX);
        let from = out.len();
        let end = frame.len() - CHECKSUM;
        out.extend_from_slice(frame);
        out[from + 2] |= FLAG_SIGNED;
        // The CRC of two messages of equal length differs by a value that does not depend on CRC_EXTRA, the seed
        // byte of the message type. CRC_EXTRA is not known for every message.
        let change =
            calculate_crc(&frame[1..end], 0) ^ calculate_crc(&out[from + 1..from + end], 0);
        let checksum = u16::from_le_bytes([frame[end], frame[end + 1]]) ^ change;
        out[from + end..].copy_from_slice(&checksum.to_le_bytes());
        out.push(link);
        out.extend_from_slice(&self.stamp.to_le_bytes()[..6]);
        let signature = self.signature(&out[from..]);
        out.extend_from_slice(&signature);
        self.counts.signed += 1;
    }

    /// The signature of a frame, computed from all bytes `before` the signature.
    fn signature(&self, before: &[u8]) -> [u8; SIGNATURE] {
        let hash = Sha256::new().chain_update(self.key.bytes()).chain_update(before).finalize();
        let mut signature = [0; SIGNATURE];
        signature.copy_from_slice(&hash[..SIGNATURE]);
        signature
    }

    /// Returns the frames of `bytes` with a valid signature and timestamp, unmodified. `unix_us` is the present time (µs since
    /// 1970). All other frames are dropped and counted.
    pub fn believed(&mut self, unix_us: u64, bytes: &[u8]) -> Vec<u8> {
        self.stamp = self.stamp.max(stamp_of(unix_us));
        let mut believed = Vec::with_capacity(bytes.len());
        pieces(bytes, |frame, _| match self.judge(frame) {
            Verdict::Believed => {
                self.counts.believed += 1;
                believed.extend_from_slice(frame);
            }
            Verdict::Unsigned => self.counts.unsigned += 1,
            Verdict::Forged => self.counts.forged += 1,
            Verdict::Replayed => self.counts.replayed += 1,
        });
        believed
    }

    fn judge(&mut self, frame: &[u8]) -> Verdict {
        let signed = frame[0] == STX && frame[2] & FLAG_SIGNED != 0;
        if !signed || frame.len() < HEADER + CHECKSUM + BLOCK {
            return Verdict::Unsigned;
        }
        let (before, signature) = frame.split_at(frame.len() - SIGNATURE);
        if self.signature(before) != signature {
            return Verdict::Forged;
        }
        let block = &before[before.len() - (BLOCK - SIGNATURE)..];
        let mut stamp = [0; 8];
        stamp[..6].copy_from_slice(&block[1..]);
        let stamp = u64::from_le_bytes(stamp);
        let stream = (block[0], Source { system: frame[5], component: frame[6] });
        let fresh = match self.streams.get(&stream) {
            Some(last) => stamp > *last,
            None => self.streams.len() < MAX_STREAMS && stamp + MINUTE >= self.stamp,
        };
        if !fresh {
            return Verdict::Replayed;
        }
        self.streams.insert(stream, stamp);
        self.stamp = self.stamp.max(stamp);
        Verdict::Believed
    }
}

/// Verification result of a frame.
enum Verdict {
    Believed,
    Unsigned,
    Forged,
    Replayed,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framing::Version;

    /// 18 November 2026, µs since 1970.
    const NOW: u64 = 1_795_000_000_000_000;

    fn key(byte: u8) -> Key {
        Key::from_bytes([byte; 32])
    }

    fn heartbeat(sequence: u8) -> Vec<u8> {
        let payload = [0, 0, 0, 0, 6, 8, 0, 4, 3];
        let source = Source { system: 7, component: 190 };
        crate::framing::write(Version::V2, sequence, source, 0, &payload).unwrap()
    }

    #[test]
    fn what_one_signs_the_other_believes_once() {
        let (mut us, mut them) = (Signer::new(key(1), 0), Signer::new(key(1), 0));
        let frames = us.sign(NOW, 3, &[heartbeat(0), heartbeat(1)].concat());
        assert_eq!(frames.len(), 2 * (heartbeat(0).len() + BLOCK));
        assert_eq!(them.believed(NOW, &frames), frames);
        assert!(them.believed(NOW, &frames).is_empty());
        let counts = them.counts();
        assert_eq!((counts.believed, counts.replayed), (2, 2));
        // One second later the timestamps are larger by 100,000.
        let later = us.sign(NOW + 1_000_000, 3, &heartbeat(2));
        assert_eq!(them.believed(NOW, &later), later);
        assert_eq!(them.stamp(), stamp_of(NOW) + 100_000);
    }

    #[test]
    fn unsigned_forged_changed_and_old_frames_are_refused() {
        let mut them = Signer::new(key(1), 0);
        assert!(them.believed(NOW, &heartbeat(0)).is_empty());
        let forged = Signer::new(key(2), 0).sign(NOW, 0, &heartbeat(0));
        assert!(them.believed(NOW, &forged).is_empty());
        // This frame was signed two minutes ago, in a stream of which nothing was received before.
        let old = Signer::new(key(1), 0).sign(NOW - 120_000_000, 0, &heartbeat(0));
        assert!(them.believed(NOW, &old).is_empty());
        let counts = them.counts();
        assert_eq!((counts.unsigned, counts.forged, counts.replayed), (1, 1, 1));
        // The link id is signed as well.
        let mut changed = Signer::new(key(1), 0).sign(NOW, 0, &heartbeat(0));
        let at = changed.len() - BLOCK;
        changed[at] ^= 1;
        assert!(them.believed(NOW, &changed).is_empty());
        assert_eq!(them.counts().forged, 2);
    }

    #[test]
    fn a_frame_of_an_unknown_message_is_signed_and_a_signed_one_keeps_its_author() {
        let mut us = Signer::new(key(1), 0);
        // A message id that no dialect has. The CRC_EXTRA in its checksum is unknown.
        let mut unknown = vec![0xFD, 2, 0, 0, 5, 7, 1, 0x39, 0x30, 0x7F, 1, 2];
        let extra = 77;
        let checksum = calculate_crc(&unknown[1..], extra);
        unknown.extend(checksum.to_le_bytes());
        let signed = us.sign(NOW, 0, &unknown);
        assert_eq!(signed.len(), unknown.len() + BLOCK);
        let right = calculate_crc(&signed[1..12], extra).to_le_bytes();
        assert_eq!(signed[12..14], right);
        assert_eq!(us.sign(NOW, 9, &signed), signed);
        assert_eq!(Signer::new(key(1), 0).believed(NOW, &signed), signed);
    }

    #[test]
    fn timestamps_go_on_from_the_last_start_without_a_clock() {
        let mut us = Signer::new(key(1), 5_000_000);
        us.sign(0, 0, &heartbeat(0));
        assert_eq!(us.stamp(), 5_000_001);
    }

    #[test]
    fn mavlink_1_cannot_be_signed_and_is_not_sent() {
        let mut us = Signer::new(key(1), 0);
        let source = Source { system: 7, component: 190 };
        let old = crate::framing::write(Version::V1, 0, source, 0, &[0; 9]).unwrap();
        assert!(us.sign(NOW, 0, &old).is_empty());
        assert_eq!(us.counts().unsignable, 1);
    }
}
