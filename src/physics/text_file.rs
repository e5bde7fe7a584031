//! Reader of text files written by users, with a limit on their length.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Largest length of a file, bytes. It is a hundred times that of the longest shipped file. The limit bounds the memory of a
/// parser, which is up to eighty times the length of the text.
pub const LONGEST: u64 = 1 << 20;

/// Reads the text of the file at `path`.
///
/// # Errors
/// If the file cannot be read, is not UTF-8, or is longer than [`LONGEST`].
pub fn read(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?.take(LONGEST + 1).read_to_end(&mut bytes)?;
    // The length is checked first: if the limit cuts a character, the rest is not valid UTF-8.
    if bytes.len() as u64 > LONGEST {
        let words = format!("it is longer than {} KiB, which no such file is", LONGEST >> 10);
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, words));
    }
    let not_utf8 = |_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8 text");
    String::from_utf8(bytes).map_err(not_utf8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_ten_megabytes_is_refused_before_it_is_taken_in() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("long.toml");
        std::fs::write(&path, "x = [0]\n".repeat(1_250_000)).unwrap();
        let refused = read(&path).unwrap_err().to_string();
        assert!(refused.contains("longer than 1024 KiB"), "{refused}");
        std::fs::write(&path, " ".repeat(LONGEST as usize)).unwrap();
        assert_eq!(read(&path).unwrap().len() as u64, LONGEST);
        // The limit cuts one of these two-byte characters.
        std::fs::write(&path, "é".repeat(LONGEST as usize)).unwrap();
        let refused = read(&path).unwrap_err().to_string();
        assert!(refused.contains("longer than 1024 KiB"), "{refused}");
    }
}
