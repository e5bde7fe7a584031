//! Reads hand-written text files of at most 1 MiB.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Largest file size, bytes. For comparison, all parameters of a firmware take 60 KiB and an airframe file 10 KiB.
const LONGEST: u64 = 1 << 20;

/// Reads the text of the file at `path`.
///
/// # Errors
/// A reason with its remedy if the file cannot be read, is not UTF-8, or is longer than 1 MiB.
pub fn read(path: &Path) -> Result<String, String> {
    let mut text = String::new();
    File::open(path)
        .and_then(|file| file.take(LONGEST + 1).read_to_string(&mut text))
        .map_err(|e| format!("cannot be read: {e}; name an existing file"))?;
    if text.len() as u64 > LONGEST {
        return Err(format!("is longer than {} KiB, which no such file is", LONGEST >> 10));
    }
    Ok(text)
}
