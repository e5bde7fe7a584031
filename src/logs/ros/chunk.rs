//! Reads the chunks of an MCAP file (a ROS 2 bag). A chunk is a record that contains compressed messages. It is unpacked while
//! it is read, and its checksum is compared at its end.

use std::io::{self, Read};

use lz4_flex::frame::FrameDecoder;
use ruzstd::decoding::StreamingDecoder;

use super::records::bytes;
use super::{LOOK, Reader};
use crate::window::Window;

/// Number of bytes in a chunk's header (times, size, checksum) before the name of the compression.
const TO_NAME: usize = 28;
/// Length of the longest name of a compression, bytes.
const NAME: usize = 16;
/// The largest accepted window of a zstd frame, bytes. Compressors need a larger one only from level 20 on.
const ZSTD_WINDOW: u64 = 8 << 20;

/// The unread rest of a record's body, of which `left` bytes remain.
pub(super) struct Body<'b, 'w> {
    pub window: &'b mut Window<'w>,
    pub left: u64,
}

impl Body<'_, '_> {
    /// Skips the rest of the body. Returns the number of bytes by which the file ends too early.
    pub fn finish(mut self) -> u64 {
        let _ = io::copy(&mut self, &mut io::sink());
        self.left
    }
}

impl Read for Body<'_, '_> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 || to.is_empty() {
            return Ok(0);
        }
        let view = self.window.view(1);
        let most = usize::try_from(self.left).unwrap_or(usize::MAX);
        let count = view.len().min(to.len()).min(most);
        to[..count].copy_from_slice(&view[..count]);
        self.window.skip(count);
        self.left -= count as u64;
        Ok(count)
    }
}

/// Whether the sizes in a chunk's header agree with the length of its record, `length`. `body` is the start of the record's
/// body. If it ends within the header, only the part that it has is checked.
pub(super) fn agrees(body: &[u8], length: u64) -> bool {
    let Some(name) = bytes(body, TO_NAME).map(|b| u32::from_le_bytes(b) as usize) else {
        return length > (TO_NAME + 12) as u64;
    };
    let size = bytes(body, TO_NAME + 4 + name).map(u64::from_le_bytes);
    let head = (TO_NAME + 4 + name + 8) as u64;
    name <= NAME && size.is_none_or(|size| size.checked_add(head) == Some(length))
}

/// A reader that computes the checksum of the bytes that were read from `source`.
struct Summed<R> {
    source: R,
    sum: crc32fast::Hasher,
}

impl<R: Read> Read for Summed<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(to)?;
        self.sum.update(&to[..count]);
        Ok(count)
    }
}

impl Reader<'_> {
    /// Reads the messages of a chunk. An invalid chunk is counted, and the rest of it is skipped.
    pub(super) fn chunk(&mut self, body: &mut Body<'_, '_>) {
        self.chunks += 1;
        if let Err(error) = self.unpacked(body) {
            self.broken += 1;
            if self.reason.is_empty() {
                self.reason = error.to_string();
            }
            self.hole();
        }
    }

    fn unpacked(&mut self, body: &mut Body<'_, '_>) -> io::Result<()> {
        let header = header(body)?;
        let mut packed = body.take(header.compressed_size);
        let plain: Box<dyn Read + '_> = match header.compression.as_str() {
            "" => Box::new(packed),
            "lz4" => Box::new(FrameDecoder::new(packed)),
            "zstd" => {
                let frame = StreamingDecoder::new_with_max_window_size(&mut packed, ZSTD_WINDOW);
                Box::new(frame.map_err(io::Error::other)?)
            }
            other => return Err(io::Error::other(format!("compression `{other}` is unknown"))),
        };
        let plain = plain.take(header.uncompressed_size);
        let mut summed = Summed { source: plain, sum: crc32fast::Hasher::new() };
        self.records(&mut summed)?;
        if summed.source.limit() > 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let sum = summed.sum.finalize();
        self.unequal += usize::from(header.uncompressed_crc != 0 && header.uncompressed_crc != sum);
        Ok(())
    }
}

/// The header of a chunk.
struct Header {
    uncompressed_size: u64,
    /// Checksum of the unpacked content; zero if there is none.
    uncompressed_crc: u32,
    compression: String,
    compressed_size: u64,
}

/// Reads the header of a chunk. At most [`NAME`] bytes of the compression's name are read.
fn header(body: &mut Body<'_, '_>) -> io::Result<Header> {
    let view = body.window.view(LOOK);
    let name = bytes(view, TO_NAME).map_or(0, |b| u32::from_le_bytes(b) as usize).min(NAME);
    let mut head = vec![0; TO_NAME + 4 + name + 8];
    body.read_exact(&mut head)?;
    let word = |at: usize| bytes(&head, at).map_or(0, u64::from_le_bytes);
    Ok(Header {
        uncompressed_size: word(16),
        uncompressed_crc: bytes(&head, 24).map_or(0, u32::from_le_bytes),
        compression: String::from_utf8_lossy(&head[TO_NAME + 4..][..name]).into_owned(),
        compressed_size: word(TO_NAME + 4 + name),
    })
}
