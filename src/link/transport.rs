//! Sockets and serial ports. All links run on one thread, the network thread, which exchanges bytes with the control thread
//! through channels.
//!
//! Received bytes go into a bounded channel that the caller chooses for each link. The vehicle's bytes can therefore be served
//! before those of the clients (ground stations and offboard programs). Frames to be sent go into a bounded channel of the link.
//! If a channel is full, frames are dropped and counted. No call blocks.

mod flood;
mod serial;
mod tcp;
mod udp;

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel::Sender as Inbox;
use thiserror::Error;
use tokio::runtime::{Builder, Handle};
use tokio::sync::{mpsc, oneshot};

use super::address::{Address, AddressError};
use super::peer::{self, LinkId, PeerId};
pub use serial::SerialFault;

/// Capacity of a link's outgoing queue, frames.
const OUTBOX: usize = 1024;
/// Interval at which the network thread increments its counter of rounds. The control thread detects from this counter that the
/// network thread is stalled.
const ROUND: Duration = Duration::from_millis(10);

/// Bytes received from a peer: one datagram, or complete frames of a byte stream.
#[derive(Clone, Debug)]
pub struct Packet {
    /// Sender of the bytes.
    pub peer: PeerId,
    /// The bytes that were received.
    pub bytes: Vec<u8>,
    /// Time of arrival, host clock.
    pub arrived: Instant,
}

/// Event on a link.
#[derive(Clone, Debug)]
pub enum Arrival {
    /// Bytes were received from a peer.
    Packet(Packet),
    /// A TCP connection or a serial port was opened. Frames can be sent to the peer before it has sent any.
    Opened(PeerId),
    /// A TCP connection or a serial port was closed.
    Closed(PeerId),
    /// A remark for the user.
    Remark(Remark),
}

/// A condition of a link that is reported to the user.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Remark {
    /// The serial port was disconnected.
    #[error("serial port {0} has gone: waiting for it to come back")]
    Unplugged(String),
    /// The serial port is available again.
    #[error("serial port {0} is back")]
    Replugged(String),
    /// Bytes are received, but none of them form a valid frame.
    #[error(
        "bytes arrive on {port}, but no MAVLink frame among them: {baud} is probably not the baud \
         rate of the other end; set its port (SER_TEL2_BAUD on PX4, SERIAL2_BAUD on ArduPilot) or \
         --vehicle to the same rate"
    )]
    Noise {
        /// Name of the device.
        port: String,
        /// Baud rate of the open port.
        baud: u32,
    },
}

/// Reason why a link cannot be opened.
#[derive(Debug, Error)]
pub enum TransportError {
    /// The address is invalid.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// The port is in use by another program.
    #[error(
        "opening {address}: port already in use: stop the other program or give another address with {option}"
    )]
    InUse {
        /// Address of the link.
        address: Address,
        /// The command-line option that named the address, such as `--client`.
        option: &'static str,
    },
    /// The operating system refused the socket.
    #[error("opening {address}: {source}; give another address with {option}")]
    Open {
        /// Address of the link.
        address: Address,
        /// The command-line option that named the address.
        option: &'static str,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The serial port cannot be opened.
    #[error("opening {address}: {fault}; {option} names the port")]
    Serial {
        /// Address of the link.
        address: Address,
        /// The command-line option that named the address.
        option: &'static str,
        /// The reason, with its remedy.
        fault: SerialFault,
    },
    /// The thread could not be started.
    #[error("starting the network thread: {0}; close other programs and try again")]
    Thread(std::io::Error),
}

/// Traffic counters of a link.
#[derive(Debug, Default)]
struct Counters {
    received: AtomicU64,
    sent: AtomicU64,
    inbox_full: AtomicU64,
    outbox_full: AtomicU64,
    send_failed: AtomicU64,
    oversize: AtomicU64,
    flooded: AtomicU64,
}

/// Traffic counters of a link since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkCounts {
    /// Number of packets received.
    pub received: u64,
    /// Number of frames sent.
    pub sent: u64,
    /// Packets dropped because the control thread's queue was full.
    pub inbox_full: u64,
    /// Frames dropped because the link's outgoing queue was full.
    pub outbox_full: u64,
    /// Frames that the operating system refused to send.
    pub send_failed: u64,
    /// Datagrams dropped because they were too long.
    pub oversize: u64,
    /// Datagrams dropped by the rate limit on their sender.
    pub flooded: u64,
}

fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// Data of a link that its receiving tasks need.
#[derive(Clone)]
struct Port {
    id: LinkId,
    inbox: Inbox<Arrival>,
    counters: Arc<Counters>,
    takes_all: bool,
}

impl Port {
    fn peer(&self, address: SocketAddr) -> PeerId {
        PeerId { link: self.id, address }
    }

    /// Queues received bytes, or drops and counts them if the queue is full.
    fn deliver(&self, address: SocketAddr, bytes: Vec<u8>) {
        count(&self.counters.received);
        let packet = Packet { peer: self.peer(address), bytes, arrived: Instant::now() };
        if self.inbox.try_send(Arrival::Packet(packet)).is_err() {
            count(&self.counters.inbox_full);
        }
    }

    /// Queues the opening or closing of a connection, or a remark. It runs on the network thread and tries again every 10 ms
    /// while the channel is full. If a closing were dropped, the session of the peer would outlive its connection.
    async fn announce(&self, mut arrival: Arrival) {
        while let Err(crossbeam_channel::TrySendError::Full(back)) = self.inbox.try_send(arrival) {
            arrival = back;
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
}

/// The thread that owns all sockets. Dropping it closes them.
pub struct Network {
    handle: Handle,
    rounds: Arc<AtomicU64>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    /// Whether the rate limit on datagram senders is disabled.
    takes_all: bool,
}

impl Network {
    /// Starts the network thread. It has no links yet.
    pub fn start() -> Result<Self, TransportError> {
        let runtime =
            Builder::new_current_thread().enable_all().build().map_err(TransportError::Thread)?;
        let handle = runtime.handle().clone();
        let (stop, stopped) = oneshot::channel::<()>();
        let rounds = Arc::new(AtomicU64::new(0));
        runtime.spawn(go_rounds(rounds.clone()));
        let thread = std::thread::Builder::new()
            .name("network".into())
            .spawn(move || {
                // ends on request, or when the owner no longer exists
                let _ = runtime.block_on(stopped);
            })
            .map_err(TransportError::Thread)?;
        Ok(Network { handle, rounds, stop: Some(stop), thread: Some(thread), takes_all: false })
    }

    /// Disables the rate limit on datagrams for links that are opened from now on. A simulation in lockstep sends as fast as it
    /// gets replies and may exceed this limit.
    pub fn take_all(&mut self) {
        self.takes_all = true;
    }

    /// Number of rounds of the network thread. It grows by one every 10 ms as long as the thread is not stalled.
    pub fn rounds(&self) -> u64 {
        self.rounds.load(Ordering::Relaxed)
    }

    /// Opens a link. Its received bytes and events go to `inbox`. Sockets are bound before the function returns, so a port in
    /// use is reported at once. `option` is the command-line option that an error names. A `tcpout:` link connects in the
    /// background and reconnects by itself.
    pub fn open(
        &self,
        id: LinkId,
        address: &Address,
        option: &'static str,
        inbox: Inbox<Arrival>,
    ) -> Result<Link, TransportError> {
        let counters = Arc::new(Counters::default());
        let port = Port { id, inbox, counters: counters.clone(), takes_all: self.takes_all };
        let (outbox, outgoing) = mpsc::channel(OUTBOX);
        let failed = |source: std::io::Error| match source.kind() {
            std::io::ErrorKind::AddrInUse => {
                TransportError::InUse { address: address.clone(), option }
            }
            _ => TransportError::Open { address: address.clone(), option, source },
        };
        // Sockets are registered with the runtime of the network thread.
        let _entered = self.handle.enter();
        let (local, target) = match address {
            Address::UdpIn(at) => {
                (Some(udp::listen(port, at.resolve()?, outgoing).map_err(failed)?), None)
            }
            Address::UdpOut(to) => {
                let to = to.resolve()?;
                (Some(udp::reach(port, to, outgoing).map_err(failed)?), Some(to))
            }
            Address::TcpIn(at) => {
                (Some(tcp::listen(port, at.resolve()?, outgoing).map_err(failed)?), None)
            }
            Address::TcpOut(to) => {
                tcp::connect(port, to.resolve()?, outgoing);
                (None, None)
            }
            Address::Serial { port: device, baud } => {
                let wire = serial::Wire { port: device.clone(), baud: *baud };
                let address = address.clone();
                let stream = wire.open().map_err(|fault| TransportError::Serial {
                    address,
                    option,
                    fault,
                })?;
                serial::serve(port, wire, stream, outgoing);
                (None, Some(peer::SERIAL))
            }
        };
        let target = target.map(|address| PeerId { link: id, address });
        Ok(Link { id, local, target, outbox, counters })
    }
}

async fn go_rounds(rounds: Arc<AtomicU64>) {
    let mut due = tokio::time::interval(ROUND);
    // Rounds that were missed in a stall are not counted later.
    due.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        due.tick().await;
        count(&rounds);
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // a panic of the thread has been reported by the thread
            let _ = thread.join();
        }
    }
}

/// The sending side of a link, for the control thread.
#[derive(Clone, Debug)]
pub struct Link {
    id: LinkId,
    local: Option<SocketAddr>,
    target: Option<PeerId>,
    outbox: mpsc::Sender<(SocketAddr, Vec<u8>)>,
    counters: Arc<Counters>,
}

impl Link {
    /// Number of the link.
    pub fn id(&self) -> LinkId {
        self.id
    }

    /// The bound address; `None` for `tcpout:` and `serial:`.
    pub fn local(&self) -> Option<SocketAddr> {
        self.local
    }

    /// The peer to which frames can be sent before it has sent any: the target of a `udpout:` link or the device on a
    /// serial port; otherwise `None`.
    pub fn target(&self) -> Option<PeerId> {
        self.target
    }

    /// Queues one frame, or drops and counts it if the queue is full. Never blocks.
    pub fn send(&self, to: PeerId, frame: Vec<u8>) {
        if self.outbox.try_send((to.address, frame)).is_err() {
            count(&self.counters.outbox_full);
        }
    }

    /// Traffic counters since the link was opened.
    pub fn counts(&self) -> LinkCounts {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        LinkCounts {
            received: read(&self.counters.received),
            sent: read(&self.counters.sent),
            inbox_full: read(&self.counters.inbox_full),
            outbox_full: read(&self.counters.outbox_full),
            send_failed: read(&self.counters.send_failed),
            oversize: read(&self.counters.oversize),
            flooded: read(&self.counters.flooded),
        }
    }
}
