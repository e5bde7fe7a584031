//! Atomic writing of files: another process sees a file complete or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

/// Reason why a file was not written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// A file with this path exists.
    #[error("{path} is already there, and was left as it is: choose another name, or move it away")]
    Exists {
        /// Path of the file.
        path: PathBuf,
    },
    /// The operating system reported an error.
    #[error(
        "writing {path}: {source}; check that its folder exists, can be written to and has room"
    )]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// Writes `text` to a new file at `path`.
///
/// # Errors
/// [`WriteError::Exists`] if `path` exists, and `WriteError::Io` if the operating system reports an error.
pub fn write_new(path: &Path, text: &str) -> Result<(), WriteError> {
    let file = written_beside(path, text.as_bytes()).map_err(|source| io_error(path, source))?;
    file.persist_noclobber(path).map(sync).map_err(|e| match e.error.kind() {
        io::ErrorKind::AlreadyExists => WriteError::Exists { path: path.into() },
        _ => io_error(path, e.error),
    })
}

/// Longest chain of symbolic links that is followed. Linux has the same limit.
const LINKS: usize = 40;

/// Writes `content` to a file at `path`, and replaces an existing one. Another process sees either the old or the new file. A
/// symbolic link remains, and its target is replaced. A device or a named pipe is opened and receives the content.
///
/// # Errors
/// `WriteError::Io` if the operating system reports an error.
pub fn write_over(path: &Path, content: impl AsRef<[u8]>) -> Result<(), WriteError> {
    let (content, wrong) = (content.as_ref(), |source| io_error(path, source));
    if fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir()) {
        let open = OpenOptions::new().write(true).open(path);
        return open.and_then(|mut device| device.write_all(content)).map_err(wrong);
    }
    let target = target(path);
    let file = written_beside(&target, content).map_err(wrong)?;
    file.persist(&target).map(sync).map_err(|e| wrong(e.error))
}

/// The target of the symbolic link `path`, which need not exist; `path` itself if it is no link.
fn target(path: &Path) -> PathBuf {
    let mut target = path.to_owned();
    for _ in 0..LINKS {
        let Ok(next) = fs::read_link(&target) else { break };
        target = target.parent().unwrap_or(Path::new("")).join(next);
    }
    target
}

fn io_error(path: &Path, source: io::Error) -> WriteError {
    WriteError::Io { path: path.into(), source }
}

/// Writes the content to a temporary file in the folder of `path`. There it can be renamed to `path` atomically.
fn written_beside(path: &Path, content: &[u8]) -> io::Result<NamedTempFile> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = Builder::new();
    builder.prefix(".greylag-").suffix(".part");
    // a temporary file is readable by its owner alone, unless other permissions are set; the umask then limits these
    #[cfg(unix)]
    let everyone: std::fs::Permissions = std::os::unix::fs::PermissionsExt::from_mode(0o666);
    #[cfg(unix)]
    builder.permissions(everyone);
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(content)?;
    Ok(file)
}

/// Flushes the file to disk. A failure gives only a warning, because the content has already been handed to the system.
fn sync(file: File) {
    if let Err(error) = file.sync_all() {
        tracing::warn!("a written file could not be synced to disk: {error}");
    }
}
