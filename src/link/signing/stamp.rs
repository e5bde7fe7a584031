//! Persistent timestamp of MAVLink 2 signatures: a thread writes it every second to a file beside the key.
//!
//! A receiver rejects signatures whose timestamp is not newer than the last one. The timestamp must therefore not go back when
//! the program restarts.

use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::STAMP_MAX;

/// Interval between two writes of the file.
const EVERY: Duration = Duration::from_secs(1);
/// Margin that is added to the stored timestamp when the file is opened: 2 s, in units of 10 µs. Timestamps in this range may
/// have been used since the last write.
const MARGIN: u64 = 200_000;

/// The timestamp cannot be stored.
#[derive(Debug, thiserror::Error)]
pub enum StampError {
    /// The file cannot be read or written.
    #[error("keeping the timestamp of signatures in {}: {why}; make its folder writable", path.display())]
    File {
        /// Path of the timestamp file.
        path: PathBuf,
        /// The operating system's error.
        why: std::io::Error,
    },
    /// The file is empty.
    #[error(
        "{} is empty, perhaps after a power failure: remove it, then choose a new key, because frames that were \
         signed with this key could be played again",
        path.display()
    )]
    Empty {
        /// Path of the timestamp file.
        path: PathBuf,
    },
    /// The file does not hold a timestamp.
    #[error("{} does not hold a timestamp of signatures: remove it, then choose a new key", path.display())]
    Content {
        /// Path of the timestamp file.
        path: PathBuf,
    },
}

/// The timestamp file and the thread that writes it.
#[derive(Debug)]
pub struct StampFile {
    shown: Arc<AtomicU64>,
    troubles: Receiver<String>,
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl StampFile {
    /// Opens the timestamp file of the key file `key` and starts its thread. Also returns the timestamp to start from, in units
    /// of 10 µs since 2015.
    ///
    /// # Errors
    ///
    /// If the file cannot be read or written, or does not hold a timestamp.
    pub fn open(key: &Path) -> Result<(Self, u64), StampError> {
        let mut name = key.as_os_str().to_owned();
        name.push(".stamp");
        let path = PathBuf::from(name);
        let failed = |why| StampError::File { path: path.clone(), why };
        let last = match fs::read_to_string(&path) {
            Ok(text) if text.trim().is_empty() => {
                return Err(StampError::Empty { path: path.clone() });
            }
            // a timestamp close to the largest would leave none for new signatures
            Ok(text) => match text.trim().parse::<u64>() {
                Ok(last) if last < STAMP_MAX - MARGIN => last,
                _ => return Err(StampError::Content { path: path.clone() }),
            },
            Err(why) if why.kind() == ErrorKind::NotFound => 0,
            Err(why) => return Err(failed(why)),
        };
        let next = if last == 0 { 0 } else { last + MARGIN };
        write(&path, next).map_err(failed)?;
        let shown = Arc::new(AtomicU64::new(next));
        let (stop, stopped) = channel::<()>();
        let (trouble, troubles) = channel();
        let (seen, place) = (shown.clone(), path.clone());
        let thread = std::thread::Builder::new()
            .name("stamp".into())
            .spawn(move || keep(&place, next, &seen, &stopped, &trouble))
            .map_err(failed)?;
        Ok((StampFile { shown, troubles, stop: Some(stop), thread: Some(thread) }, next))
    }

    /// The first error of the thread as text; `None` if there was no error or it was returned before.
    pub fn trouble(&self) -> Option<String> {
        self.troubles.try_recv().ok()
    }

    /// Passes the newest timestamp to the thread, which writes it within about a second.
    pub fn show(&self, stamp: u64) {
        self.shown.store(stamp, Ordering::Relaxed);
    }
}

impl Drop for StampFile {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // the thread itself has reported its panic
            let _ = thread.join();
        }
    }
}

/// Writes the timestamp `seen` to `path` every second, and once more when `stopped` is closed. `written` is the timestamp that
/// the file already holds. The first error is sent to `trouble`.
fn keep(
    path: &Path,
    mut written: u64,
    seen: &AtomicU64,
    stopped: &Receiver<()>,
    trouble: &Sender<String>,
) {
    let mut reported = false;
    loop {
        let ends = stopped.recv_timeout(EVERY) != Err(RecvTimeoutError::Timeout);
        let now = seen.load(Ordering::Relaxed);
        if now != written {
            match write(path, now) {
                Ok(()) => written = now,
                // a disk that is full for a while does little harm: the next write stores the newest timestamp
                Err(why) if !reported => {
                    reported = true;
                    let words = format!(
                        "{} not written, signed frames may be replayed: {why}",
                        path.display()
                    );
                    // nobody receives it after the end of the flight
                    let _ = trouble.send(words);
                }
                Err(_) => {}
            }
        }
        if ends {
            return;
        }
    }
}

/// Replaces the file atomically. After a power failure it holds the old or the new timestamp.
fn write(path: &Path, stamp: u64) -> std::io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    writeln!(file, "{stamp}")?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_timestamp_goes_on_after_a_restart_beyond_all_that_was_used() {
        let folder = tempfile::tempdir().unwrap();
        let key = folder.path().join("key");
        let (file, first) = StampFile::open(&key).unwrap();
        assert_eq!(first, 0);
        file.show(123_456_789);
        drop(file);
        let (_file, next) = StampFile::open(&key).unwrap();
        assert_eq!(next, 123_456_789 + MARGIN);
    }

    #[test]
    fn a_timestamp_that_cannot_be_written_is_reported_once() {
        let folder = tempfile::tempdir().unwrap();
        let (file, _) = StampFile::open(&folder.path().join("key")).unwrap();
        folder.close().unwrap();
        file.show(1);
        let end = std::time::Instant::now() + Duration::from_secs(20);
        let words = loop {
            match file.trouble() {
                Some(words) => break words,
                None => assert!(std::time::Instant::now() < end, "nothing is reported"),
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        assert!(words.contains("key.stamp not written"), "{words}");
        // The next attempt fails as well.
        file.show(2);
        std::thread::sleep(EVERY + EVERY / 2);
        assert_eq!(file.trouble(), None);
    }

    #[test]
    fn an_empty_file_is_refused_with_its_cure() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("key.stamp"), "\n").unwrap();
        let error = StampFile::open(&folder.path().join("key")).unwrap_err();
        assert!(matches!(error, StampError::Empty { .. }), "{error}");
        assert!(error.to_string().contains("choose a new key"), "{error}");
    }

    #[test]
    fn a_file_of_something_else_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        // A word, and numbers beyond the 48 bits of a timestamp.
        for content in ["yesterday", "281474976710656", "18446744073709551615"] {
            fs::write(folder.path().join("key.stamp"), content).unwrap();
            let words = StampFile::open(&folder.path().join("key")).unwrap_err().to_string();
            assert!(words.contains("does not hold a timestamp"), "{content}: {words}");
        }
    }
}
