//! A writer that simulates a disk which becomes full.

use std::io::{Error, ErrorKind, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A writer that discards its bytes. While `full` is set, writing fails as on a full disk.
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
