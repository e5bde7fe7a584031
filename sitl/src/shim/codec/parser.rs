//! Finds MAVLink frames in received bytes.

use super::frame::{Frame, MAGIC_1, MAGIC_2, Version, checksum};
use super::messages::crc_extra;

/// Finds frames in datagrams or in a stream and counts all other bytes.
#[derive(Clone, Debug, Default)]
pub struct Parser {
    held: Vec<u8>,
    in_garbage: bool,
    bad: u64,
    unknown: u64,
}

/// Content at the front of a byte sequence.
enum Front {
    /// A valid frame of this many bytes.
    Frame(Box<Frame>, usize),
    /// A frame of this many bytes with a message that the shim does not define.
    Unknown(usize),
    /// Bytes that may become a frame when more bytes arrive.
    Unfinished,
    /// Bytes that do not begin a frame.
    Garbage,
}

/// Whether more bytes may follow.
#[derive(Clone, Copy, PartialEq)]
enum After {
    More,
    Nothing,
}

impl Parser {
    /// Number of byte runs that were not part of a frame: wrong checksum, truncated frame or noise.
    pub fn bad(&self) -> u64 {
        self.bad
    }

    /// Number of frames with messages that the shim does not define and whose checksum it therefore cannot check.
    pub fn unknown(&self) -> u64 {
        self.unknown
    }

    /// Passes every valid frame of one datagram to `sink`; an unfinished frame at the end counts as bad.
    pub fn datagram(&mut self, bytes: &[u8], sink: &mut dyn FnMut(Frame)) {
        self.scan(bytes, After::Nothing, sink);
        self.in_garbage = false;
    }

    /// Passes every valid frame that `bytes` completes to `sink`, and keeps an unfinished frame for the next call.
    pub fn stream(&mut self, bytes: &[u8], sink: &mut dyn FnMut(Frame)) {
        let mut held = std::mem::take(&mut self.held);
        held.extend_from_slice(bytes);
        let used = self.scan(&held, After::More, sink);
        held.drain(..used);
        self.held = held;
    }

    /// Discards an unfinished frame after the end of a stream.
    pub fn restart(&mut self) {
        self.bad += u64::from(!self.held.is_empty() && !self.in_garbage);
        self.held.clear();
        self.in_garbage = false;
    }

    fn scan(&mut self, bytes: &[u8], after: After, sink: &mut dyn FnMut(Frame)) -> usize {
        let mut at = 0;
        while at < bytes.len() {
            match front(&bytes[at..]) {
                Front::Frame(frame, length) => {
                    self.in_garbage = false;
                    at += length;
                    sink(*frame);
                }
                Front::Unknown(length) => {
                    self.in_garbage = false;
                    self.unknown += 1;
                    at += length;
                }
                Front::Unfinished if after == After::More => break,
                Front::Unfinished | Front::Garbage => {
                    self.bad += u64::from(!self.in_garbage);
                    self.in_garbage = true;
                    at += 1;
                }
            }
        }
        at
    }
}

/// Offsets of the parts of a frame, in bytes.
struct Layout {
    version: Version,
    header: usize,
    id: u32,
    /// Offset of the system and component IDs.
    from: usize,
    signature: usize,
}

fn front(bytes: &[u8]) -> Front {
    let layout = match layout(bytes) {
        Ok(layout) => layout,
        Err(front) => return front,
    };
    let length = usize::from(bytes[1]);
    let end = layout.header + length + 2;
    let total = end + layout.signature;
    if bytes.len() < total {
        return Front::Unfinished;
    }
    let Some(extra) = crc_extra(layout.id) else {
        // The checksum cannot be checked: the frame is accepted only if another frame or the end of the data follows.
        let plausible = matches!(bytes.get(total), None | Some(&(MAGIC_1 | MAGIC_2)));
        return if plausible { Front::Unknown(total) } else { Front::Garbage };
    };
    let sum = u16::from_le_bytes([bytes[end - 2], bytes[end - 1]]);
    if checksum(&bytes[1..end - 2], extra) != sum {
        return Front::Garbage;
    }
    Front::Frame(Box::new(frame(bytes, &layout, length)), total)
}

fn frame(bytes: &[u8], layout: &Layout, length: usize) -> Frame {
    let mut payload = [0; 255];
    payload[..length].copy_from_slice(&bytes[layout.header..layout.header + length]);
    Frame {
        version: layout.version,
        sequence: bytes[layout.from - 1],
        system: bytes[layout.from],
        component: bytes[layout.from + 1],
        id: layout.id,
        length: length as u8,
        payload,
    }
}

fn layout(bytes: &[u8]) -> Result<Layout, Front> {
    match bytes[0] {
        MAGIC_2 if bytes.len() < 10 => Err(Front::Unfinished),
        // Of the incompatibility flags, only 0x01 (a signature behind the frame) is supported.
        MAGIC_2 if bytes[2] & !1 != 0 => Err(Front::Garbage),
        MAGIC_2 => Ok(Layout {
            version: Version::Two,
            header: 10,
            id: u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]),
            from: 5,
            signature: if bytes[2] & 1 == 1 { 13 } else { 0 },
        }),
        MAGIC_1 if bytes.len() < 6 => Err(Front::Unfinished),
        MAGIC_1 => Ok(Layout {
            version: Version::One,
            header: 6,
            id: u32::from(bytes[5]),
            from: 3,
            signature: 0,
        }),
        _ => Err(Front::Garbage),
    }
}
