//! Check that the bytes of a log record are exactly one MAVLink frame.
//!
//! The dialect is the set of messages that this program knows. The CRC of a frame can be checked only for these messages.

use super::{Candidate, Frame, examine};

/// Classification of bytes that should be exactly one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Whole<'a> {
    /// A frame of the dialect with a valid CRC.
    Known(Frame<'a>),
    /// A plausible frame of a message outside the dialect.
    Unknown,
    /// Bytes that are not a frame, or not exactly one.
    Damaged,
}

/// Classifies bytes that should be one frame.
pub fn whole(bytes: &[u8]) -> Whole<'_> {
    if bytes.is_empty() {
        return Whole::Damaged;
    }
    match examine(bytes) {
        Candidate::Frame(frame) if frame.bytes.len() == bytes.len() => Whole::Known(frame),
        Candidate::Unknown { len } if len == bytes.len() => Whole::Unknown,
        _ => Whole::Damaged,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Source, Version, write};
    use super::*;

    #[test]
    fn a_frame_is_whole_with_all_of_its_bytes_only() {
        let source = Source { system: 1, component: 1 };
        let bytes = write(Version::V2, 7, source, 0, &[1; 9]).unwrap();
        let Whole::Known(frame) = whole(&bytes) else { panic!() };
        assert_eq!((frame.id, frame.sequence, frame.payload), (0, 7, &[1; 9][..]));
        for end in 0..bytes.len() {
            assert_eq!(whole(&bytes[..end]), Whole::Damaged, "{end}");
        }
        assert_eq!(whole(&[&bytes[..], b"x"].concat()), Whole::Damaged);
        let mut unknown = bytes.clone();
        unknown[7..10].fill(0xEE);
        assert_eq!(whole(&unknown), Whole::Unknown);
        let mut damaged = bytes;
        damaged[12] ^= 1;
        assert_eq!(whole(&damaged), Whole::Damaged);
    }
}
