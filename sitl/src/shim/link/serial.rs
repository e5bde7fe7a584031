//! Byte stream over a serial port or over a pseudo-terminal that the shim creates.

use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};

use super::tcp::{flush, is_lull};
use super::{Address, Arrival, LinkError, PATIENCE, Transport, Wait};

/// Time between attempts to reopen a lost port.
const RETRY: Duration = Duration::from_millis(100);

/// Device behind the link.
#[derive(Debug)]
enum End {
    /// A serial port of this computer.
    Device { path: String, baud: u32 },
    /// A pseudo-terminal of the shim; the companion opens its other end under this name.
    Pseudo { name: PathBuf },
}

/// A serial line with at most one companion at the other end.
#[derive(Debug)]
pub struct SerialLink {
    end: End,
    wait: Wait,
    port: Option<TTYPort>,
    /// The unsent rest of a batch. It is sent before other bytes, because a frame must not be split.
    unsent: Vec<u8>,
    /// Whether no process has the other end open.
    hung_up: bool,
    next_look: Instant,
    buffer: Box<[u8; 4096]>,
}

impl SerialLink {
    pub(super) fn open(address: &Address, wait: Wait) -> Result<Self, LinkError> {
        let failed = |error: io::Error| LinkError::serial(address, error);
        let (end, port) = match address.transport {
            Transport::Pty => {
                let name = PathBuf::from(&address.endpoint);
                let port = pseudo(&name).map_err(failed)?;
                (End::Pseudo { name }, port)
            }
            _ => {
                let (path, baud) = address.device();
                let port = device(&path, baud).map_err(failed)?;
                (End::Device { path, baud }, port)
            }
        };
        let mut link = SerialLink {
            end,
            wait,
            port: None,
            unsent: Vec::new(),
            hung_up: false,
            next_look: Instant::now(),
            buffer: Box::new([0; 4096]),
        };
        link.use_port(port).map_err(failed)?;
        Ok(link)
    }

    fn use_port(&mut self, mut port: TTYPort) -> io::Result<()> {
        let patience = if self.wait == Wait::Patient { PATIENCE } else { Duration::ZERO };
        port.set_timeout(patience)?;
        self.unsent.clear();
        self.port = Some(port);
        Ok(())
    }

    pub(super) fn send(&mut self, bytes: &[u8]) -> bool {
        let Some(port) = self.port.as_mut().filter(|_| !self.hung_up) else {
            return false;
        };
        let sent = flush(port, &mut self.unsent).and_then(|()| {
            if !self.unsent.is_empty() {
                return Ok(false);
            }
            self.unsent.extend_from_slice(bytes);
            flush(port, &mut self.unsent).map(|()| true)
        });
        sent.unwrap_or_else(|_| {
            self.unsent.clear();
            false
        })
    }

    pub(super) fn receive(&mut self) -> Arrival<'_> {
        if self.port.is_none() && !self.look() {
            if self.wait == Wait::Patient {
                thread::sleep(PATIENCE);
            }
            return Arrival::Nothing;
        }
        let Some(port) = &mut self.port else { return Arrival::Nothing };
        match port.read(&mut self.buffer[..]) {
            Ok(length) if length > 0 => {
                self.hung_up = false;
                Arrival::Bytes(&self.buffer[..length])
            }
            Err(error) if is_lull(&error) => {
                self.hung_up = false;
                Arrival::Nothing
            }
            Ok(_) | Err(_) => self.ended(),
        }
    }

    /// Handles the loss of the other end: a pseudo-terminal waits for it, and a serial port is reopened.
    fn ended(&mut self) -> Arrival<'static> {
        if self.wait == Wait::Patient {
            thread::sleep(PATIENCE);
        }
        let was = std::mem::replace(&mut self.hung_up, true);
        self.unsent.clear();
        if matches!(self.end, End::Device { .. }) {
            self.port = None;
            self.next_look = Instant::now() + RETRY;
        }
        if was { Arrival::Nothing } else { Arrival::Closed }
    }

    /// Tries to reopen the port, at most once every `RETRY`; returns whether the port is open.
    fn look(&mut self) -> bool {
        let now = Instant::now();
        let End::Device { path, baud } = &self.end else { return false };
        if now < self.next_look {
            return false;
        }
        self.next_look = now + RETRY;
        let Ok(port) = device(path, *baud) else { return false };
        self.hung_up = false;
        self.use_port(port).is_ok()
    }
}

impl Drop for SerialLink {
    fn drop(&mut self) {
        if let End::Pseudo { name } = &self.end {
            // The name would otherwise point to a terminal that no longer exists.
            let _ = std::fs::remove_file(name);
        }
    }
}

fn device(path: &str, baud: u32) -> io::Result<TTYPort> {
    serialport::new(path, baud).open_native().map_err(Into::into)
}

/// A new pseudo-terminal; `name` becomes a link to the companion's end.
fn pseudo(name: &Path) -> io::Result<TTYPort> {
    let (far, near) = TTYPort::pair()?;
    let path = near.name().ok_or_else(|| io::Error::other("the pseudo-terminal has no name"))?;
    // A name may be replaced only if its terminal no longer exists.
    if name.is_symlink() && !name.exists() {
        std::fs::remove_file(name)?;
    }
    std::os::unix::fs::symlink(path, name)?;
    Ok(far)
}
