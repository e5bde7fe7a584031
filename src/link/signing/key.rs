//! The key for signing MAVLink frames. It is stored in a file that only its owner can read.

use std::fmt;
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// Length of a key in bytes.
const LENGTH: usize = 32;
/// Largest number of bytes that are read from a key file.
const LONGEST: u64 = 4096;

/// A secret key. `Debug` does not print it.
#[derive(Clone)]
pub struct Key([u8; LENGTH]);

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key(secret)")
    }
}

/// Reason why a key file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// The file cannot be read.
    #[error("cannot read key file {}: {why}; {}", path.display(), read_remedy(.why))]
    Read {
        /// Path of the key file.
        path: PathBuf,
        /// The operating system's error.
        why: std::io::Error,
    },
    /// The file is readable by other users.
    #[error("key file {} may be read by others (mode {mode:03o}): chmod 600 it, then choose a new key", path.display())]
    Open {
        /// Path of the key file.
        path: PathBuf,
        /// Permission bits of the file.
        mode: u32,
    },
    /// The file cannot be written.
    #[error("cannot write key file {}: {why}; give the name of a file that does not exist", path.display())]
    Write {
        /// Path of the key file.
        path: PathBuf,
        /// The operating system's error.
        why: std::io::Error,
    },
    /// The file does not hold a key.
    #[error(
        "key file {} does not hold 64 hexadecimal digits: make one with `greylag link key FILE`, or, from \
         a passphrase as MAVProxy does, with `greylag link key --passphrase FILE`",
        path.display()
    )]
    Content {
        /// Path of the key file.
        path: PathBuf,
    },
}

impl Key {
    /// A key from its bytes.
    pub fn from_bytes(bytes: [u8; LENGTH]) -> Self {
        Key(bytes)
    }

    /// The SHA-256 of a passphrase, as QGroundControl and MAVProxy derive it.
    pub fn of_passphrase(passphrase: &str) -> Self {
        Key(Sha256::digest(passphrase.as_bytes()).into())
    }

    /// Writes the key to a new file that only its owner can read.
    ///
    /// # Errors
    ///
    /// If the file exists or cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), KeyError> {
        let failed = |why| KeyError::Write { path: path.into(), why };
        let mut options = File::options();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let mut file = options.open(path).map_err(failed)?;
        let digits: String = self.0.iter().map(|byte| format!("{byte:02x}")).collect();
        writeln!(file, "{digits}").map_err(failed)
    }

    pub(super) fn bytes(&self) -> &[u8; LENGTH] {
        &self.0
    }

    /// Reads a key file: 64 hexadecimal digits, permission bits 0600 or stricter.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, is readable by other users, or does not hold a key.
    pub fn load(path: &Path) -> Result<Self, KeyError> {
        let failed = |why| KeyError::Read { path: path.into(), why };
        let file = File::open(path).map_err(failed)?;
        check_mode(&file, path)?;
        let mut text = String::new();
        let content = || KeyError::Content { path: path.into() };
        file.take(LONGEST).read_to_string(&mut text).map_err(|why| match why.kind() {
            std::io::ErrorKind::InvalidData => content(),
            _ => failed(why),
        })?;
        digits(text.trim()).map(Key).ok_or_else(content)
    }
}

/// Remedy for a key file that cannot be read.
fn read_remedy(why: &std::io::Error) -> &'static str {
    use std::io::ErrorKind;
    match why.kind() {
        ErrorKind::NotFound => "make one: greylag link key FILE",
        ErrorKind::PermissionDenied => "let the file and its folder belong to the user who flies",
        ErrorKind::IsADirectory => "name the key file, not its folder",
        _ => "check the file and its disk, or make another key: greylag link key FILE",
    }
}

/// Decodes 64 hexadecimal digits.
fn digits(text: &str) -> Option<[u8; LENGTH]> {
    if text.len() != 2 * LENGTH || !text.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    let mut bytes = [0; LENGTH];
    for (i, byte) in bytes.iter_mut().enumerate() {
        *byte = u8::from_str_radix(&text[2 * i..2 * i + 2], 16).ok()?;
    }
    Some(bytes)
}

#[cfg(unix)]
fn check_mode(file: &File, path: &Path) -> Result<(), KeyError> {
    use std::os::unix::fs::PermissionsExt;
    let found = file.metadata().map_err(|why| KeyError::Read { path: path.into(), why })?;
    match found.permissions().mode() & 0o777 {
        mode if mode & 0o077 != 0 => Err(KeyError::Open { path: path.into(), mode }),
        _ => Ok(()),
    }
}

/// On a system without Unix permissions, the permissions of the key file are not checked.
#[cfg(not(unix))]
fn check_mode(_: &File, _: &Path) -> Result<(), KeyError> {
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    fn file(text: &str, mode: u32) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("key");
        std::fs::write(&path, text).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
        (folder, path)
    }

    #[test]
    fn a_key_that_is_made_is_its_owners_alone_and_overwrites_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new");
        // SHA-256 of "abc", FIPS 180-2.
        let key = Key::of_passphrase("abc");
        key.save(&path).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(Key::load(&path).unwrap().bytes()[..4], [0xba, 0x78, 0x16, 0xbf]);
        let again = Key::from_bytes([1; 32]).save(&path).unwrap_err().to_string();
        assert!(again.contains("does not exist"), "{again}");
        assert_eq!(Key::load(&path).unwrap().bytes()[0], 0xba);
    }

    #[test]
    fn a_key_is_read_and_never_shown() {
        let (_folder, path) = file(&format!("{}\n", "0aFf".repeat(16)), 0o600);
        let key = Key::load(&path).unwrap();
        assert_eq!(key.bytes()[..2], [0x0a, 0xff]);
        assert_eq!(format!("{key:?}"), "Key(secret)");
    }

    #[test]
    fn a_key_that_others_may_read_is_refused() {
        let digits = "00".repeat(32);
        for mode in [0o640, 0o604, 0o644] {
            let (_folder, path) = file(&digits, mode);
            let words = Key::load(&path).unwrap_err().to_string();
            assert!(words.contains("chmod 600") && words.contains(&format!("{mode:o}")), "{words}");
        }
    }

    #[test]
    fn a_key_file_is_made_only_where_there_is_none() {
        let words = |kind: std::io::ErrorKind| {
            KeyError::Read { path: "key".into(), why: kind.into() }.to_string()
        };
        let missing = words(std::io::ErrorKind::NotFound);
        assert!(missing.contains("make one: greylag link key FILE"), "{missing}");
        let denied = words(std::io::ErrorKind::PermissionDenied);
        assert!(!denied.contains("link key") && denied.contains("belong to the user"), "{denied}");
    }

    #[test]
    fn anything_but_64_digits_is_refused() {
        // One digit too few, one too many, a passphrase, and characters of two bytes.
        for text in ["0".repeat(63), "0".repeat(65), "secret".into(), "ä".repeat(32)] {
            let (_folder, path) = file(&text, 0o600);
            assert!(matches!(Key::load(&path), Err(KeyError::Content { .. })), "{text}");
        }
        assert!(matches!(Key::load("nowhere".as_ref()), Err(KeyError::Read { .. })));
    }
}
