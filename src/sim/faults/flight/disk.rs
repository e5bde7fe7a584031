//! A writer that becomes a full disk at a given time.

use std::io::{Error, ErrorKind, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A writer that fails as a full disk from a given time on.
#[derive(Clone, Debug, Default)]
pub(super) struct Disk {
    pub(super) full: Arc<AtomicBool>,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self.full.load(Ordering::Relaxed) {
            true => Err(Error::from(ErrorKind::StorageFull)),
            false => Ok(bytes.len()),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
