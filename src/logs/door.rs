//! Opens a log file: unpacks gzip, recognises UTF-16, and splits a path such as `FILE#2` into the file and a flight's number.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;

/// First bytes of a gzip file.
const GZIP: [u8; 2] = [0x1F, 0x8B];
/// Number of bytes at the start of a file from which its format is recognised.
pub(super) const LOOK: usize = 4096;

/// An open file whose first bytes were read. A compressed file is unpacked while it is read.
pub(super) struct Opened {
    /// The first bytes of the unpacked content.
    pub start: Vec<u8>,
    rest: Box<dyn Read>,
}

impl Opened {
    /// Opens the file at `path` and reads its first bytes.
    ///
    /// # Errors
    /// The error of the operating system.
    pub fn file(path: &Path) -> io::Result<Opened> {
        let (start, file) = begun(Box::new(File::open(path)?))?;
        if !start.starts_with(&GZIP) {
            return Ok(Opened { start, rest: file });
        }
        let packed = io::Cursor::new(start).chain(file);
        let (start, rest) = begun(Box::new(MultiGzDecoder::new(packed)))?;
        Ok(Opened { start, rest })
    }

    /// A reader of the whole unpacked content.
    pub fn reader(self) -> Box<dyn Read> {
        Box::new(io::Cursor::new(self.start).chain(self.rest))
    }
}

fn begun(mut source: Box<dyn Read>) -> io::Result<(Vec<u8>, Box<dyn Read>)> {
    let mut start = Vec::new();
    source.by_ref().take(LOOK as u64).read_to_end(&mut start)?;
    Ok((start, source))
}

/// Splits a path such as `FILE#2` into the file and the number of the flight in it. The number is `None` if the path ends with
/// none, if a file with the whole name exists, or if no file `FILE` exists.
pub(super) fn part(path: &Path) -> (PathBuf, Option<usize>) {
    let text = path.to_string_lossy();
    let named = text.rsplit_once('#').and_then(|(file, number)| {
        let number = number.parse::<usize>().ok().filter(|n| *n > 0)?;
        (!path.exists() && Path::new(file).exists()).then(|| (PathBuf::from(file), Some(number)))
    });
    named.unwrap_or((path.to_owned(), None))
}

/// Byte order of UTF-16.
#[derive(Clone, Copy)]
enum Wide {
    Little,
    Big,
}

/// Byte order of UTF-16 text that begins with `start`. It follows from the byte order mark, or from the zero bytes
/// between ASCII letters. `None` if the text is not UTF-16.
fn wide(start: &[u8]) -> Option<Wide> {
    match start {
        [0xFF, 0xFE, ..] => return Some(Wide::Little),
        [0xFE, 0xFF, ..] => return Some(Wide::Big),
        _ => {}
    }
    let letters = |zero: usize| {
        let pairs = start.chunks_exact(2).take(16);
        start.len() >= 32 && pairs.into_iter().all(|p| p[zero] == 0 && p[1 - zero] >= b'\t')
    };
    if letters(1) { Some(Wide::Little) } else { letters(0).then_some(Wide::Big) }
}

/// Whether a text that begins with `start` is in UTF-16.
pub(super) fn is_wide(start: &[u8]) -> bool {
    wide(start).is_some()
}

/// Converts text from UTF-16 to UTF-8; `None` if `bytes` are not UTF-16.
pub(super) fn narrowed(bytes: &[u8]) -> Option<Vec<u8>> {
    let wide = wide(bytes)?;
    let unit = |pair: &[u8]| match wide {
        Wide::Little => u16::from_le_bytes([pair[0], pair[1]]),
        Wide::Big => u16::from_be_bytes([pair[0], pair[1]]),
    };
    let letters = char::decode_utf16(bytes.chunks_exact(2).map(unit));
    let text: String = letters.map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    Some(text.trim_start_matches('\u{feff}').as_bytes().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utf_16_of_either_order_is_read_with_and_without_its_mark() {
        let text = "time_s,roll_rad,pitch_rad\n0.01,0.2,0.3\n";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let marked = [&[0xFF, 0xFE][..], &little].concat();
        for bytes in [&little, &big, &marked] {
            assert_eq!(narrowed(bytes).unwrap(), text.as_bytes());
        }
        assert_eq!(narrowed(text.as_bytes()), None);
    }
}
