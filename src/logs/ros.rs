//! Reads ROS 2 recordings ("bags") in MCAP files into topics: those of MAVROS and `px4_msgs`, and any other that a mapping file
//! names.
//!
//! An MCAP file consists of records: definitions of message types, channels (topics with their type), messages, and chunks,
//! which contain compressed records. Chunks are unpacked while they are read. Only requested messages are kept. After a damaged
//! place, reading resumes at the next chunk or message.
//!
//! The time of a message is the timestamp ("stamp") that it contains: `timestamp_sample` or `timestamp` of `px4_msgs`,
//! `header.stamp` of others. A message without a stamp gets the recorder's time, converted to the clock of the stamps. Stamps
//! may jump relative to the recorder's time, as PX4's do at time synchronisation. A jump of more than [`JUMP_S`] is removed by
//! means of the recorder's time.
//!
//! Topics of `px4_msgs` get the names and fields of ULog (`/fmu/out/vehicle_status_v1` becomes `vehicle_status`). The name of a
//! MAVROS topic is the part after `/mavros/`. Other topics keep their names without the first slash.
//!
//! Not read: definitions in `ros2idl`, messages in encodings other than CDR, bags of several files.

mod cdr;
mod chunk;
mod definition;
mod records;
mod streams;
#[cfg(test)]
mod tests;

use std::io::{self, Read};

use super::finding::Finding;
use super::format::MCAP_MAGIC;
use super::stretches::Keep;
use super::topics::Topics;
use super::window::Window;
use chunk::Body;
use records::{bytes, op};
use streams::Streams;

/// Size of a record's header (code and length), bytes.
const HEAD: usize = 9;
/// Size of a message's header (channel, sequence number and two times), bytes.
const MESSAGE: usize = 22;
/// The longest message or definition that is read, bytes. Longer messages are only counted.
const LONGEST: u64 = 1 << 20;
/// Number of bytes from which it is decided whether a record begins at a place or the file is damaged there.
const LOOK: usize = 4096;
/// Largest jump of the stamps relative to the recorder's time that is kept, s.
const JUMP_S: f64 = 5.0;

struct Reader<'w> {
    streams: Streams<'w>,
    /// The bytes of the present record.
    buffer: Vec<u8>,
    /// Whether a valid record ends at the present place of the file.
    in_step: bool,
    /// Number of bytes that belong to no record.
    skipped: usize,
    /// Length of the gap at each damaged place, s: from the last message before it to the first one after it. NaN until that
    /// message is read.
    holes: Vec<f64>,
    /// The recorder's time of the last message, ns since 1970.
    last_ns: Option<u64>,
    chunks: usize,
    /// Number of chunks that could not be read to their end, and the reason for the first.
    broken: usize,
    reason: String,
    /// Number of chunks with a wrong checksum.
    unequal: usize,
    /// Number of bytes that are missing from the last record.
    lacking: u64,
    /// Whether a record that marks the end of the data or of the file was read.
    ended: bool,
}

/// Reads the fields for which `wanted(topic, field)` is true. The messages of all topics are counted.
pub(super) fn read<'a>(
    source: &'a mut dyn Read,
    wanted: &dyn Fn(&str, &str) -> bool,
    keep: Keep,
) -> (Vec<Topics>, Window<'a>) {
    let mut window = Window::new(source);
    let mut reader = Reader {
        streams: Streams::new(wanted, keep),
        buffer: Vec::new(),
        in_step: true,
        skipped: 0,
        holes: Vec::new(),
        last_ns: None,
        chunks: 0,
        broken: 0,
        reason: String::new(),
        unequal: 0,
        lacking: 0,
        ended: false,
    };
    window.view(MCAP_MAGIC.len());
    window.skip(MCAP_MAGIC.len());
    loop {
        let view = window.view(LOOK);
        if view.starts_with(&MCAP_MAGIC) {
            window.skip(MCAP_MAGIC.len());
            continue;
        }
        if view.len() < HEAD {
            reader.lacking += (HEAD - view.len()) as u64 * u64::from(!view.is_empty());
            break;
        }
        match reader.head(view) {
            Some((code, length)) => reader.place(&mut window, code, length),
            None => reader.damaged(&mut window),
        }
    }
    (reader.finish(), window)
}

impl Reader<'_> {
    /// Code and length of the record at the beginning of `view`; `None` if no record can begin there.
    ///
    /// Chunks and their indices state their length twice, and both values must agree. After a damaged place, only a chunk or a
    /// message on a known channel is accepted as the next record.
    fn head(&self, view: &[u8]) -> Option<(u8, u64)> {
        let (code, length) = (*view.first()?, u64::from_le_bytes(bytes(view, 1)?));
        let body = &view[HEAD..];
        // if the end of the file cuts a record off, only its existing bytes are checked
        let agrees = match code {
            op::CHUNK => chunk::agrees(body, length),
            op::MESSAGE_INDEX => {
                bytes(body, 2).is_none_or(|size| u64::from(u32::from_le_bytes(size)) + 6 == length)
            }
            op::MESSAGE => {
                let channel = bytes(body, 0).map(u16::from_le_bytes);
                length >= MESSAGE as u64 && channel.is_none_or(|c| self.streams.knows(c))
            }
            op::DATA_END => length == 4,
            op::FOOTER => length == 20,
            _ => (1..=op::DATA_END).contains(&code) || code >= op::PRIVATE,
        };
        let sure = self.in_step || matches!(code, op::CHUNK | op::MESSAGE);
        (agrees && sure && length < 1 << 48).then_some((code, length))
    }

    /// Reads the record at the beginning of `window`.
    fn place(&mut self, window: &mut Window<'_>, code: u8, length: u64) {
        self.in_step = true;
        self.ended |= matches!(code, op::DATA_END | op::FOOTER);
        window.skip(HEAD);
        let mut body = Body { window, left: length };
        if code == op::CHUNK {
            self.chunk(&mut body);
        } else {
            // the error is not needed, because missing bytes are counted below
            let _ = self.record(code, length, &mut body);
        }
        self.lacking += body.finish();
    }

    /// Skips and counts a byte that belongs to no record.
    fn damaged(&mut self, window: &mut Window<'_>) {
        self.hole();
        self.in_step = false;
        self.skipped += 1;
        window.skip(1);
    }

    /// Notes the start of a damaged place. The time that is lost there follows from the next message.
    fn hole(&mut self) {
        if self.in_step {
            self.holes.push(f64::NAN);
        }
    }

    /// Reads all records in `from`.
    fn records(&mut self, from: &mut dyn Read) -> io::Result<()> {
        loop {
            let mut head = [0; HEAD];
            match from.read(&mut head[..1])? {
                0 => return Ok(()),
                _ => from.read_exact(&mut head[1..])?,
            }
            let length = u64::from_le_bytes(bytes(&head, 1).unwrap_or_default());
            self.record(head[0], length, from)?;
        }
    }

    /// Reads a record with this code and `length` bytes from `from`.
    ///
    /// # Errors
    /// If `from` ends within the record, or cannot be read.
    fn record(&mut self, code: u8, length: u64, from: &mut dyn Read) -> io::Result<()> {
        self.buffer.clear();
        match code {
            op::SCHEMA if length <= LONGEST => {
                self.fill(length, from)?;
                self.streams.define(records::schema(&self.buffer));
                Ok(())
            }
            op::CHANNEL if length <= LONGEST => {
                self.fill(length, from)?;
                self.streams.declare(records::channel(&self.buffer));
                Ok(())
            }
            op::MESSAGE if length >= MESSAGE as u64 => {
                self.fill(MESSAGE as u64, from)?;
                let channel = bytes(&self.buffer, 0).map_or(0, u16::from_le_bytes);
                let log_ns = bytes(&self.buffer, 6).map_or(0, u64::from_le_bytes);
                self.passed(log_ns);
                let rest = length - MESSAGE as u64;
                if !self.streams.counts(channel, length <= LONGEST) {
                    return pass(rest, from);
                }
                self.fill(rest, from)?;
                self.streams.take(channel, log_ns, &self.buffer[MESSAGE..]);
                Ok(())
            }
            _ => pass(length, from),
        }
    }

    /// Appends `length` bytes of `from` to the buffer. Memory is allocated only for bytes that exist.
    fn fill(&mut self, length: u64, from: &mut dyn Read) -> io::Result<()> {
        let read = from.take(length).read_to_end(&mut self.buffer)?;
        if read as u64 == length { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
    }

    /// Notes the recorder's time of a message, ns since 1970. If a damaged place precedes the message, computes the time that was
    /// lost there.
    fn passed(&mut self, log_ns: u64) {
        if let Some(hole) = self.holes.last_mut().filter(|hole| hole.is_nan()) {
            let last = self.last_ns.unwrap_or(log_ns);
            *hole = log_ns.saturating_sub(last) as f64 * 1e-9;
        }
        self.last_ns = Some(log_ns);
    }

    fn finish(self) -> Vec<Topics> {
        let mut said = Vec::new();
        let lost: f64 = self.holes.iter().filter(|s| s.is_finite()).sum();
        if self.lacking > 0 {
            said.push(format!(
                "the file ends in the middle of a record, {} bytes of which are missing",
                self.lacking
            ));
        } else if !self.ended {
            said.push(
                "the file has no end record: the recorder did not close it, or the copy is cut; it is read up to there"
                    .to_owned(),
            );
        }
        if self.skipped > 0 {
            said.push(format!(
                "{} bytes of the file belong to no record and were skipped: it is damaged there",
                self.skipped
            ));
        }
        if self.broken > 0 {
            let (broken, chunks, why) = (self.broken, self.chunks, &self.reason);
            said.push(format!(
                "{broken} of {chunks} chunks could not be read to their end (the first: {why})"
            ));
        }
        if self.unequal > 0 {
            said.push(format!(
                "{} of {} chunks do not have their checksum: some of their messages may be wrong",
                self.unequal, self.chunks
            ));
        }
        if !self.holes.is_empty() {
            said.push(format!(
                "damage took {lost:.2} s of messages, at {} places",
                self.holes.len()
            ));
        }
        self.streams.finish(said.into_iter().map(Finding::warning).collect())
    }
}

/// Skips `length` bytes of `from`.
fn pass(length: u64, from: &mut dyn Read) -> io::Result<()> {
    let passed = io::copy(&mut from.take(length), &mut io::sink())?;
    if passed == length { Ok(()) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
}
