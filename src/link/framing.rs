//! Parser and encoder of MAVLink frames.
//!
//! [`Frames`] parses a datagram, [`StreamCutter`] a byte stream. Both accept MAVLink 1 and 2 and check the CRC. After
//! bytes that are not a frame they resynchronise on the next start marker. Signed frames (incompatibility flag 0x01)
//! are accepted without a check of the signature; `signing::Signer::believed` checks it. Frames with any other
//! incompatibility flag are refused, as the MAVLink guide requires.

mod checksum;
mod record;

use super::wire::crc_extra;
use checksum::checksum;
pub use record::{Whole, whole};

/// Start marker of MAVLink 1.
const STX_V1: u8 = 0xFE;
/// Start marker of MAVLink 2.
const STX_V2: u8 = 0xFD;
/// Length of the header before the payload in MAVLink 1 and 2, bytes.
const HEADER_V1: usize = 6;
const HEADER_V2: usize = 10;
const CHECKSUM: usize = 2;
const SIGNATURE: usize = 13;
const FLAG_SIGNED: u8 = 0x01;
/// Length of the longest frame, bytes: MAVLink 2 with full payload and signature.
pub const MAX_FRAME: usize = HEADER_V2 + 255 + CHECKSUM + SIGNATURE;
/// Largest number of false starts in one datagram or chunk. At the next one the rest is dropped. A false start is a start
/// marker without a valid frame. Each costs a CRC over up to 267 bytes. The limit bounds the time for noise to a few
/// microseconds.
const MAX_FALSE_STARTS: u32 = 32;
/// Largest number of frames from one datagram or chunk. MAVLink 2 frames have at least 12 bytes, so a datagram of 1500 bytes
/// holds fewer.
const MAX_FRAMES: u32 = 128;

/// MAVLink protocol version of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// MAVLink 1: start marker 0xFE, message ids up to 255.
    V1,
    /// MAVLink 2: start marker 0xFD, message ids up to 2²⁴ − 1, trailing zeros of the payload truncated.
    V2,
}

/// Sender of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Source {
    /// System id of the MAVLink node.
    pub system: u8,
    /// Component id of the MAVLink node.
    pub component: u8,
}

/// A complete frame with a valid CRC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Protocol version of the frame.
    pub version: Version,
    /// Sequence number of the sender.
    pub sequence: u8,
    /// Sender of the frame.
    pub source: Source,
    /// Id of the message type.
    pub id: u32,
    /// Payload as sent. MAVLink 2 truncates its trailing zeros.
    pub payload: &'a [u8],
    /// Whether the frame has a signature. The signature is not checked here.
    pub signed: bool,
    /// The frame from its start marker to its last byte, for logs and routing.
    pub bytes: &'a [u8],
}

/// Counters of parsed frames. A candidate is a start marker with the bytes after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Complete frames with a valid CRC.
    pub good: u64,
    /// Candidates with an invalid CRC, or with an unknown message id and no start marker behind them.
    pub bad_crc: u64,
    /// Plausible frames of messages outside the dialect (the set of known messages). Their CRC cannot be checked.
    pub unknown: u64,
    /// Candidates that are longer than the rest of the datagram.
    pub truncated: u64,
    /// Candidates with an unsupported incompatibility flag.
    pub refused: u64,
    /// Bytes dropped because a datagram held too many frames or false starts.
    pub dropped_bytes: u64,
}

impl FrameCounts {
    /// Adds another count to this one.
    pub fn add(&mut self, other: FrameCounts) {
        self.good += other.good;
        self.bad_crc += other.bad_crc;
        self.unknown += other.unknown;
        self.truncated += other.truncated;
        self.refused += other.refused;
        self.dropped_bytes += other.dropped_bytes;
    }

    /// Number of candidates that were not valid frames of the dialect.
    pub fn bad(&self) -> u64 {
        self.bad_crc + self.unknown + self.truncated + self.refused
    }
}

/// Classification of a candidate by [`examine`].
enum Candidate<'a> {
    Frame(Frame<'a>),
    BadCrc,
    Refused,
    Unknown { len: usize },
    Incomplete,
}

/// Length of the frame at the start of `bytes`; `None` without a start marker or with too few bytes to determine it.
pub fn frame_len(bytes: &[u8]) -> Option<usize> {
    let payload = usize::from(*bytes.get(1)?);
    match bytes[0] {
        STX_V1 => Some(HEADER_V1 + payload + CHECKSUM),
        STX_V2 => {
            let signed = bytes.get(2)? & FLAG_SIGNED != 0;
            Some(HEADER_V2 + payload + CHECKSUM + if signed { SIGNATURE } else { 0 })
        }
        _ => None,
    }
}

/// Classifies `bytes`, which begin with a start marker.
fn examine(bytes: &[u8]) -> Candidate<'_> {
    let v1 = bytes[0] == STX_V1;
    let header = if v1 { HEADER_V1 } else { HEADER_V2 };
    if !v1 && bytes.len() > 2 && bytes[2] & !FLAG_SIGNED != 0 {
        return Candidate::Refused;
    }
    if bytes.len() < header {
        return Candidate::Incomplete;
    }
    let signed = !v1 && bytes[2] & FLAG_SIGNED != 0;
    let end = header + bytes[1] as usize;
    let len = end + CHECKSUM + if signed { SIGNATURE } else { 0 };
    let (sequence, system, component, id) = match v1 {
        true => (bytes[2], bytes[3], bytes[4], bytes[5] as u32),
        false => {
            (bytes[4], bytes[5], bytes[6], u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]))
        }
    };
    if bytes.len() < len {
        return Candidate::Incomplete;
    }
    let Some(extra) = crc_extra(id) else {
        return Candidate::Unknown { len };
    };
    if checksum(&bytes[1..end], extra).to_le_bytes() != bytes[end..end + CHECKSUM] {
        return Candidate::BadCrc;
    }
    Candidate::Frame(Frame {
        version: if v1 { Version::V1 } else { Version::V2 },
        sequence,
        source: Source { system, component },
        id,
        payload: &bytes[header..end],
        signed,
        bytes: &bytes[..len],
    })
}

/// One item found by [`Frames`].
enum Piece<'a> {
    /// A frame with a valid CRC whose message is in the dialect.
    Known(Frame<'a>),
    /// A plausible frame of a message outside the dialect. It can be forwarded but not decoded.
    Unknown(&'a [u8]),
}

/// Iterator over the frames of one datagram.
pub struct Frames<'a, 'c> {
    rest: &'a [u8],
    counts: &'c mut FrameCounts,
    frames_left: u32,
    starts_left: u32,
    /// Whether more bytes may follow. If so, an incomplete candidate is kept.
    waits: bool,
}

impl<'a, 'c> Frames<'a, 'c> {
    /// Parses a complete datagram and updates `counts`.
    pub fn new(datagram: &'a [u8], counts: &'c mut FrameCounts) -> Self {
        Frames {
            rest: datagram,
            counts,
            frames_left: MAX_FRAMES,
            starts_left: MAX_FALSE_STARTS,
            waits: false,
        }
    }

    /// Skips the first byte, which is a false start. After too many false starts, drops all bytes.
    fn false_start(&mut self) {
        match self.starts_left.checked_sub(1) {
            Some(left) => {
                self.starts_left = left;
                self.rest = &self.rest[1..];
            }
            None => self.drop_rest(),
        }
    }

    fn drop_rest(&mut self) {
        self.counts.dropped_bytes += self.rest.len() as u64;
        self.rest = &[];
    }
}

/// Whether a frame of `len` bytes with an unknown message ends at the end of the bytes or before another start marker.
/// If not, it counts as noise, because skipping `len` bytes could skip valid frames.
fn ends_well(bytes: &[u8], len: usize) -> bool {
    bytes.get(len).is_none_or(|next| matches!(*next, STX_V1 | STX_V2))
}

impl<'a> Frames<'a, '_> {
    fn next_piece(&mut self) -> Option<Piece<'a>> {
        loop {
            let start = self.rest.iter().position(|b| matches!(*b, STX_V1 | STX_V2));
            self.rest = &self.rest[start.unwrap_or(self.rest.len())..];
            if self.rest.is_empty() {
                return None;
            }
            if self.frames_left == 0 {
                self.drop_rest();
                return None;
            }
            match examine(self.rest) {
                Candidate::Frame(frame) => {
                    self.counts.good += 1;
                    self.frames_left -= 1;
                    self.rest = &self.rest[frame.bytes.len()..];
                    return Some(Piece::Known(frame));
                }
                Candidate::Unknown { len } if ends_well(self.rest, len) => {
                    self.counts.unknown += 1;
                    self.frames_left -= 1;
                    let (unknown, rest) = self.rest.split_at(len);
                    self.rest = rest;
                    return Some(Piece::Unknown(unknown));
                }
                Candidate::Incomplete if self.waits => return None,
                Candidate::Incomplete => {
                    self.counts.truncated += 1;
                    self.false_start();
                }
                Candidate::Refused => {
                    self.counts.refused += 1;
                    self.false_start();
                }
                Candidate::BadCrc | Candidate::Unknown { .. } => {
                    self.counts.bad_crc += 1;
                    self.false_start();
                }
            }
        }
    }
}

impl<'a> Iterator for Frames<'a, '_> {
    type Item = Frame<'a>;

    fn next(&mut self) -> Option<Frame<'a>> {
        loop {
            if let Piece::Known(frame) = self.next_piece()? {
                return Some(frame);
            }
        }
    }
}

/// Delivers the bytes of every frame in `bytes`, including frames of unknown messages, for a router. Frames of known
/// messages are also delivered in parsed form.
pub fn pieces<'a>(bytes: &'a [u8], mut deliver: impl FnMut(&'a [u8], Option<Frame<'a>>)) {
    let mut counts = FrameCounts::default();
    let mut frames = Frames::new(bytes, &mut counts);
    while let Some(piece) = frames.next_piece() {
        match piece {
            Piece::Known(frame) => deliver(frame.bytes, Some(frame)),
            Piece::Unknown(bytes) => deliver(bytes, None),
        }
    }
}

/// Parses frames from a byte stream. Between chunks it buffers less than one frame.
#[derive(Clone, Debug, Default)]
pub struct StreamCutter {
    pending: Vec<u8>,
    /// Counters since the start.
    pub counts: FrameCounts,
}

impl StreamCutter {
    /// Parses the next chunk and delivers each completed frame.
    pub fn push(&mut self, chunk: &[u8], deliver: impl FnMut(Frame<'_>)) {
        self.pending.extend_from_slice(chunk);
        self.cut(true, deliver);
    }

    /// Discards an incomplete candidate and delivers the frames behind its start marker. It is called after a silence of the
    /// stream. Without it, a false start marker could delay these frames.
    pub fn flush(&mut self, deliver: impl FnMut(Frame<'_>)) {
        self.cut(false, deliver);
    }

    /// Whether an incomplete frame is buffered.
    pub fn is_waiting(&self) -> bool {
        !self.pending.is_empty()
    }

    /// Like [`StreamCutter::push`], for a router: delivers the bytes of each frame, including unknown messages.
    pub fn push_pieces(&mut self, chunk: &[u8], deliver: impl FnMut(&[u8])) {
        self.pending.extend_from_slice(chunk);
        self.cut_pieces(true, deliver);
    }

    /// Like [`StreamCutter::flush`], for a router.
    pub fn flush_pieces(&mut self, deliver: impl FnMut(&[u8])) {
        self.cut_pieces(false, deliver);
    }

    fn cut(&mut self, waits: bool, deliver: impl FnMut(Frame<'_>)) {
        let mut frames = Frames { waits, ..Frames::new(&self.pending, &mut self.counts) };
        frames.by_ref().for_each(deliver);
        let left = frames.rest.len();
        self.pending.drain(..self.pending.len() - left);
    }

    fn cut_pieces(&mut self, waits: bool, mut deliver: impl FnMut(&[u8])) {
        let mut frames = Frames { waits, ..Frames::new(&self.pending, &mut self.counts) };
        while let Some(piece) = frames.next_piece() {
            match piece {
                Piece::Known(frame) => deliver(frame.bytes),
                Piece::Unknown(bytes) => deliver(bytes),
            }
        }
        let left = frames.rest.len();
        self.pending.drain(..self.pending.len() - left);
    }
}

/// Encodes one unsigned frame. MAVLink 2 truncates the payload's trailing zeros. `None` for a message outside the dialect,
/// and for ids above 255 in MAVLink 1.
pub fn write(
    version: Version,
    sequence: u8,
    source: Source,
    id: u32,
    payload: &[u8],
) -> Option<Vec<u8>> {
    let extra = crc_extra(id)?;
    let payload = payload.get(..255).unwrap_or(payload);
    let mut bytes = Vec::with_capacity(HEADER_V2 + payload.len() + CHECKSUM);
    match version {
        Version::V1 => {
            let id = u8::try_from(id).ok()?;
            bytes.extend([
                STX_V1,
                payload.len() as u8,
                sequence,
                source.system,
                source.component,
                id,
            ]);
            bytes.extend_from_slice(payload);
        }
        Version::V2 => {
            let len =
                payload.iter().rposition(|b| *b != 0).map_or(1, |last| last + 1).min(payload.len());
            let [a, b, c, _] = id.to_le_bytes();
            bytes.extend([
                STX_V2,
                len as u8,
                0,
                0,
                sequence,
                source.system,
                source.component,
                a,
                b,
                c,
            ]);
            bytes.extend_from_slice(&payload[..len]);
        }
    }
    let crc = checksum(&bytes[1..], extra);
    bytes.extend(crc.to_le_bytes());
    Some(bytes)
}
