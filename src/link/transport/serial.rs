//! Serial links: one peer on a port that may be disconnected at any time.

use std::path::Path;
use std::time::{Duration, Instant};

use tokio::io::{AsyncReadExt, AsyncWriteExt, ReadHalf, WriteHalf};
use tokio::sync::mpsc::Receiver;
use tokio::time::{sleep, timeout};
use tokio_serial::{ErrorKind, SerialPort, SerialPortBuilderExt, SerialStream};

use super::{Arrival, Port, Remark, count};
use crate::framing::StreamCutter;
use crate::peer::{self, PeerId};

/// Largest number of bytes per read.
const CHUNK: usize = 1024;
/// Silence after which an incomplete frame is dropped.
const PARTIAL_FRAME_TIMEOUT: Duration = Duration::from_millis(50);
/// Interval between attempts to reopen a port.
const RETRY: Duration = Duration::from_millis(200);
/// Longest time for writing a frame. After this time the port counts as blocked, and the frame is dropped.
const STALLED: Duration = Duration::from_secs(1);
/// Largest number of frames that wait for the port. If there are more, the oldest are dropped as obsolete.
const BACKLOG: usize = 16;
/// A wrong baud rate is reported after this number of bytes without a valid frame, but not before this time has passed.
const NOISE: (u64, Duration) = (400, Duration::from_secs(1));

/// A serial port and its baud rate.
#[derive(Clone, Debug)]
pub(super) struct Wire {
    pub(super) port: String,
    pub(super) baud: u32,
}

/// A serial port cannot be opened. The message names the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SerialFault {
    /// The device does not exist.
    #[error("there is no such device; plug it in, or choose one of: {0}")]
    Missing(String),
    /// The user lacks permission.
    #[error(
        "permission denied; add your user to the group that owns the device \
         (`sudo usermod -aG dialout $USER`, on Arch `uucp`), then log in again"
    )]
    Permission,
    /// The port is in use by another program.
    #[error(
        "another program has it open; stop that program (often ModemManager or a ground station)"
    )]
    Busy,
    /// The port does not support this baud rate.
    #[error(
        "it does not work at {0} baud; give a rate that it supports, such as 921600, 115200 or 57600"
    )]
    Baud(u32),
    /// The file is not a serial port.
    #[error("it is not a serial port; choose one of: {0}")]
    NoPort(String),
    /// Any other error of the operating system.
    #[error("{0}; check the cable, then the name of the device")]
    Other(String),
}

/// Serial ports known to the system, for the remedy in an error.
fn listed() -> String {
    let names: Vec<String> = tokio_serial::available_ports()
        .unwrap_or_default()
        .into_iter()
        .map(|port| port.port_name)
        .filter(|name| !name.starts_with("/dev/ttyS"))
        .collect();
    if names.is_empty() { "(no serial device is plugged in)".into() } else { names.join(", ") }
}

impl Wire {
    /// Opens the serial port at its baud rate.
    pub(super) fn open(&self) -> Result<SerialStream, SerialFault> {
        let stream = tokio_serial::new(&self.port, self.baud)
            .open_native_async()
            .map_err(|error| self.fault(&error))?;
        match stream.baud_rate() {
            Ok(baud) if baud != self.baud => Err(SerialFault::Baud(self.baud)),
            _ => Ok(stream),
        }
    }

    fn fault(&self, error: &tokio_serial::Error) -> SerialFault {
        use std::io::ErrorKind as Io;
        let words = error.to_string();
        match error.kind() {
            ErrorKind::Io(Io::NotFound) => SerialFault::Missing(listed()),
            ErrorKind::Io(Io::PermissionDenied) => SerialFault::Permission,
            ErrorKind::NoDevice if Path::new(&self.port).exists() => SerialFault::Busy,
            ErrorKind::NoDevice => SerialFault::Missing(listed()),
            ErrorKind::InvalidInput => SerialFault::Baud(self.baud),
            _ if words.contains("ioctl") || words.contains("typewriter") => {
                SerialFault::NoPort(listed())
            }
            _ => SerialFault::Other(words),
        }
    }
}

/// Serves the port, and reopens it after a disconnection.
pub(super) fn serve(
    port: Port,
    wire: Wire,
    first: SerialStream,
    mut outgoing: Receiver<(std::net::SocketAddr, Vec<u8>)>,
) {
    tokio::spawn(async move {
        let peer = port.peer(peer::SERIAL);
        let mut stream = Some(first);
        while let Some(open) = stream.take() {
            port.announce(Arrival::Opened(peer)).await;
            let (reading, writing) = tokio::io::split(open);
            tokio::select! {
                () = read(&port, reading, peer, &wire) => {}
                ended = write(&port, writing, &mut outgoing) => if ended { return },
            }
            port.announce(Arrival::Closed(peer)).await;
            port.announce(Arrival::Remark(Remark::Unplugged(wire.port.clone()))).await;
            stream = wait_for(&port, &wire, &mut outgoing).await;
        }
    });
}

/// Retries until the port opens; `None` if the link has ended. Frames to be sent in the meantime are dropped and
/// counted.
async fn wait_for(
    port: &Port,
    wire: &Wire,
    outgoing: &mut Receiver<(std::net::SocketAddr, Vec<u8>)>,
) -> Option<SerialStream> {
    loop {
        sleep(RETRY).await;
        loop {
            match outgoing.try_recv() {
                Ok(_) => count(&port.counters.send_failed),
                Err(tokio::sync::mpsc::error::TryRecvError::Empty) => break,
                Err(tokio::sync::mpsc::error::TryRecvError::Disconnected) => return None,
            }
        }
        if let Ok(stream) = wire.open() {
            port.announce(Arrival::Remark(Remark::Replugged(wire.port.clone()))).await;
            return Some(stream);
        }
    }
}

/// Detects a stream of bytes without valid frames.
struct NoiseDetector {
    since: Instant,
    bytes: u64,
    frames: u64,
    reported: bool,
}

impl NoiseDetector {
    fn new() -> Self {
        NoiseDetector { since: Instant::now(), bytes: 0, frames: 0, reported: false }
    }

    /// Counts received bytes and frames. Returns `true` once: when a wrong baud rate is to be reported.
    fn is_noise(&mut self, bytes: usize, frames: usize) -> bool {
        self.bytes += bytes as u64;
        self.frames += frames as u64;
        if self.frames > 0 {
            *self = NoiseDetector { reported: self.reported, ..NoiseDetector::new() };
            return false;
        }
        let noise = self.bytes >= NOISE.0 && self.since.elapsed() >= NOISE.1 && !self.reported;
        self.reported |= noise;
        noise
    }
}

/// Reads until the port is disconnected, and delivers complete frames.
async fn read(port: &Port, mut stream: ReadHalf<SerialStream>, peer: PeerId, wire: &Wire) {
    let mut cutter = StreamCutter::default();
    let mut chunk = [0; CHUNK];
    let mut noise = NoiseDetector::new();
    loop {
        let mut whole = Vec::new();
        let mut keep = |frame: &[u8]| whole.extend_from_slice(frame);
        let good = cutter.counts.good;
        let len = match cutter.is_waiting() {
            true => {
                timeout(PARTIAL_FRAME_TIMEOUT, stream.read(&mut chunk)).await.unwrap_or_else(|_| {
                    cutter.flush_pieces(&mut keep);
                    Err(std::io::ErrorKind::TimedOut.into())
                })
            }
            false => stream.read(&mut chunk).await,
        };
        let len = match len {
            Ok(0) => return,
            Ok(len) => {
                cutter.push_pieces(&chunk[..len], &mut keep);
                len
            }
            Err(e) if e.kind() == std::io::ErrorKind::TimedOut => 0,
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => 0,
            Err(_) => return,
        };
        if noise.is_noise(len, (cutter.counts.good - good) as usize) {
            let remark = Remark::Noise { port: wire.port.clone(), baud: wire.baud };
            port.announce(Arrival::Remark(remark)).await;
        }
        if !whole.is_empty() {
            port.deliver(peer.address, whole);
        }
    }
}

/// Writes complete frames. Returns `true` if the link's last sender is gone, `false` if the port is disconnected.
async fn write(
    port: &Port,
    mut stream: WriteHalf<SerialStream>,
    outgoing: &mut Receiver<(std::net::SocketAddr, Vec<u8>)>,
) -> bool {
    while let Some((_, mut frame)) = outgoing.recv().await {
        while outgoing.len() > BACKLOG
            && let Ok((_, newer)) = outgoing.try_recv()
        {
            count(&port.counters.outbox_full);
            frame = newer;
        }
        // The port is not flushed: a flush waits until the last bit is sent.
        match timeout(STALLED, stream.write_all(&frame)).await {
            Ok(Ok(())) => count(&port.counters.sent),
            Ok(Err(_)) => {
                count(&port.counters.send_failed);
                return false;
            }
            // the write is blocked: a part of the frame may have been sent, which the receiver drops
            Err(_) => count(&port.counters.send_failed),
        }
    }
    true
}
