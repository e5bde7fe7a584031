//! The five log formats. A file's first bytes show which format it has.

use serde::Serialize;

use super::{dataflash_text, foreign};

/// Format of a flight log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Table of comma-separated values.
    Csv,
    /// ULog of the PX4 logger (`.ulg`).
    Ulog,
    /// DataFlash log of ArduPilot (`.bin`, or `.log` in text).
    Dataflash,
    /// Telemetry log of MAVLink frames (`.tlog`).
    Tlog,
    /// Recording of ROS 2 messages ("bag") in the file format MCAP (`.mcap`).
    Ros,
}

/// First bytes of a ULog file.
pub(super) const ULOG_MAGIC: [u8; 7] = [0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35];
/// First bytes of an MCAP file.
pub(super) const MCAP_MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// First bytes of every DataFlash record.
pub(super) const DATAFLASH_MAGIC: [u8; 2] = [0xA3, 0x95];
/// First byte of a MAVLink 1 frame and of a MAVLink 2 frame. In a `.tlog`, eight bytes with the time precede each frame.
pub(super) const MAVLINK_MARKERS: [u8; 2] = [0xFE, 0xFD];

impl Format {
    /// The format of a file that begins with `bytes`; `None` if it is none of the five.
    pub fn of(bytes: &[u8]) -> Option<Format> {
        if bytes.starts_with(&ULOG_MAGIC) {
            return Some(Format::Ulog);
        }
        if bytes.starts_with(&MCAP_MAGIC) {
            return Some(Format::Ros);
        }
        if bytes.starts_with(&DATAFLASH_MAGIC) {
            return Some(Format::Dataflash);
        }
        // a `.tlog` begins with a big-endian time in µs, whose first byte is zero; no text begins with a zero byte
        if bytes.first() == Some(&0) && bytes.get(8).is_some_and(|b| MAVLINK_MARKERS.contains(b)) {
            return Some(Format::Tlog);
        }
        let start = &bytes[..bytes.len().min(4096)];
        if dataflash_text::begins(start) {
            return Some(Format::Dataflash);
        }
        if foreign::kind(start).is_some() {
            return None;
        }
        let header = start.split(|b| *b == b'\n').next().unwrap_or_default();
        let text =
            !header.is_empty() && header.iter().all(|b| *b >= b' ' || *b == b'\t' || *b == b'\r');
        let separated = header.iter().any(|b| b",;\t".contains(b));
        (text && separated).then_some(Format::Csv)
    }

    /// The name of the format as shown to the user.
    pub fn name(self) -> &'static str {
        match self {
            Format::Csv => "CSV table",
            Format::Ulog => "PX4 ULog",
            Format::Dataflash => "ArduPilot DataFlash",
            Format::Tlog => "MAVLink telemetry log",
            Format::Ros => "ROS 2 bag",
        }
    }
}
