//! The folder of a recording. Existing recordings are never overwritten.

use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Destination of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A new folder inside this folder: `0001`, `0002` … Its number is one above the highest number present.
    Numbered(PathBuf),
    /// Exactly this folder, which must not exist yet.
    Exactly(PathBuf),
}

/// Reason why a recording cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The folder exists already.
    #[error("cannot record to {}: it exists already; name a new folder (fly --record, demo --out) or move the old one away", path.display())]
    Exists {
        /// Path of the folder.
        path: PathBuf,
    },
    /// A file or folder cannot be created.
    #[error("cannot create recording {}: {source}; name a folder that can be written", path.display())]
    File {
        /// Path of the file or folder.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
}

impl Place {
    /// Creates the folder and returns its path.
    pub(super) fn create(&self) -> Result<PathBuf, RecordError> {
        match self {
            Place::Numbered(root) => numbered(root),
            Place::Exactly(path) => {
                if let Some(parent) = path.parent() {
                    fs::create_dir_all(parent).map_err(|source| failure(parent, source))?;
                }
                fs::create_dir(path).map_err(|source| match source.kind() {
                    ErrorKind::AlreadyExists => RecordError::Exists { path: path.clone() },
                    _ => failure(path, source),
                })?;
                Ok(path.clone())
            }
        }
    }
}

fn failure(path: &Path, source: std::io::Error) -> RecordError {
    RecordError::File { path: path.to_owned(), source }
}

fn numbered(root: &Path) -> Result<PathBuf, RecordError> {
    fs::create_dir_all(root).map_err(|source| failure(root, source))?;
    let entries = fs::read_dir(root).map_err(|source| failure(root, source))?;
    let number = |name: std::ffi::OsString| name.to_str().and_then(|n| n.parse::<u32>().ok());
    let mut next = entries.flatten().filter_map(|e| number(e.file_name())).max().unwrap_or(0);
    loop {
        next = next.saturating_add(1);
        let path = root.join(format!("{next:04}"));
        match fs::create_dir(&path) {
            Ok(()) => return Ok(path),
            // Another program has created this folder in the meantime.
            Err(error) if error.kind() == ErrorKind::AlreadyExists && next < u32::MAX => {}
            Err(error) => return Err(failure(&path, error)),
        }
    }
}

/// Creates a new file in the folder. Fails if the file exists.
pub(super) fn create(folder: &Path, name: &str) -> Result<File, RecordError> {
    let path = folder.join(name);
    File::create_new(&path).map_err(|source| failure(&path, source))
}
