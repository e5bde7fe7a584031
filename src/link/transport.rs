//! The sockets and ports: every link of the program on one thread, with channels to the control
//! thread.
//!
//! What arrives goes into a bounded channel that the caller chooses for each link, so that the
//! vehicle's traffic can be served before the clients'. What is sent goes into a bounded channel
//! of the link. A full channel drops and counts; nothing here ever blocks its caller.

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

/// Frames that may wait to be sent on one link.
const OUTBOX: usize = 1024;
/// Between two rounds of the thread that are counted.
const ROUND: Duration = Duration::from_millis(10);

/// Bytes from a peer: one datagram, or whole frames from a stream.
#[derive(Clone, Debug)]
pub struct Packet {
    /// Who sent it.
    pub peer: PeerId,
    /// What was sent.
    pub bytes: Vec<u8>,
    /// When it arrived, host clock.
    pub arrived: Instant,
}

/// What happens on a link.
#[derive(Clone, Debug)]
pub enum Arrival {
    /// Bytes came.
    Packet(Packet),
    /// A TCP connection is up: the peer may be spoken to before it says anything.
    Opened(PeerId),
    /// A TCP connection is gone, or a serial port.
    Closed(PeerId),
    /// Something about the link itself that its user should know.
    Remark(Remark),
}

/// What is to be said about a link.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Remark {
    /// The serial port has gone.
    #[error("serial port {0} has gone: waiting for it to come back")]
    Unplugged(String),
    /// The serial port is there again.
    #[error("serial port {0} is back")]
    Replugged(String),
    /// Bytes come, but no frame among them.
    #[error(
        "bytes arrive on {port}, but no MAVLink frame among them: {baud} is probably not the baud \
         rate of the other end; set its port (SER_TEL2_BAUD on PX4, SERIAL2_BAUD on ArduPilot) or \
         --vehicle to the same rate"
    )]
    Noise {
        /// The device.
        port: String,
        /// The rate it is open at.
        baud: u32,
    },
}

/// Why a link cannot be opened.
#[derive(Debug, Error)]
pub enum TransportError {
    /// The address cannot be used.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// Another program has the port.
    #[error(
        "opening {address}: port already in use: stop the other program or give another address with {option}"
    )]
    InUse {
        /// The address.
        address: Address,
        /// The command-line option it came from, such as `--client`.
        option: &'static str,
    },
    /// The system refused the socket.
    #[error("opening {address}: {source}; give another address with {option}")]
    Open {
        /// The address.
        address: Address,
        /// The command-line option it came from.
        option: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The serial port cannot be opened.
    #[error("opening {address}: {fault}; {option} names the port")]
    Serial {
        /// The address.
        address: Address,
        /// The command-line option it came from.
        option: &'static str,
        /// What is wrong with it.
        fault: SerialFault,
    },
    /// The thread could not be started.
    #[error("starting the network thread: {0}; close other programs and try again")]
    Thread(std::io::Error),
}

/// What a link could not pass on.
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

/// A link's traffic since it was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkCounts {
    /// Packets received.
    pub received: u64,
    /// Frames sent.
    pub sent: u64,
    /// Packets dropped because the control thread did not fetch them in time.
    pub inbox_full: u64,
    /// Frames dropped because the network did not take them in time.
    pub outbox_full: u64,
    /// Frames that the system refused to send.
    pub send_failed: u64,
    /// Datagrams dropped for their size.
    pub oversize: u64,
    /// Datagrams dropped because their sender sends more than anybody has to say.
    pub flooded: u64,
}

fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// The receiving end of a link as its tasks see it.
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

    /// Passes bytes on, or drops them when nobody fetches.
    fn deliver(&self, address: SocketAddr, bytes: Vec<u8>) {
        count(&self.counters.received);
        let packet = Packet { peer: self.peer(address), bytes, arrived: Instant::now() };
        if self.inbox.try_send(Arrival::Packet(packet)).is_err() {
            count(&self.counters.inbox_full);
        }
    }

    /// Passes on that a connection is up or gone. This must not be lost to a full channel, or a
    /// session would outlive its connection, so it waits, off the control thread.
    async fn announce(&self, mut arrival: Arrival) {
        while let Err(crossbeam_channel::TrySendError::Full(back)) = self.inbox.try_send(arrival) {
            arrival = back;
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
}

/// The thread that owns every socket. Dropping it closes them all.
pub struct Network {
    handle: Handle,
    rounds: Arc<AtomicU64>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    /// Whether one sender of datagrams is listened to without limit.
    takes_all: bool,
}

impl Network {
    /// Starts the thread, with no link yet.
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
                // Ends when asked to, or when the owner is gone.
                let _ = runtime.block_on(stopped);
            })
            .map_err(TransportError::Thread)?;
        Ok(Network { handle, rounds, stop: Some(stop), thread: Some(thread), takes_all: false })
    }

    /// Links that are opened from now on take every datagram: a simulation in lockstep sends as fast as it is answered.
    pub fn take_all(&mut self) {
        self.takes_all = true;
    }

    /// How many rounds the thread has gone, one in 10 ms while it runs: between two of them every socket was looked at.
    pub fn rounds(&self) -> u64 {
        self.rounds.load(Ordering::Relaxed)
    }

    /// Opens a link whose arrivals go to `inbox`. Sockets are bound before this returns, so that
    /// a port in use is one error at the start; `option` is what the error tells the user to
    /// change. A `tcpout:` link connects, and connects again, by itself.
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
        // Sockets are registered with the runtime of the thread that will serve them.
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
    // After a stall the rounds that were missed stay missed.
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
            // A panic there has already been reported by its own thread.
            let _ = thread.join();
        }
    }
}

/// The sending end of a link, for the control thread.
#[derive(Clone, Debug)]
pub struct Link {
    id: LinkId,
    local: Option<SocketAddr>,
    target: Option<PeerId>,
    outbox: mpsc::Sender<(SocketAddr, Vec<u8>)>,
    counters: Arc<Counters>,
}

impl Link {
    /// The link's number.
    pub fn id(&self) -> LinkId {
        self.id
    }

    /// The address it is bound to; none for `tcpout:` and `serial:`.
    pub fn local(&self) -> Option<SocketAddr> {
        self.local
    }

    /// The peer to speak to unasked: the target of a `udpout:` link, the end of a serial wire.
    pub fn target(&self) -> Option<PeerId> {
        self.target
    }

    /// Sends one frame, or drops and counts it when the network does not keep up. Never blocks.
    pub fn send(&self, to: PeerId, frame: Vec<u8>) {
        if self.outbox.try_send((to.address, frame)).is_err() {
            count(&self.counters.outbox_full);
        }
    }

    /// The traffic so far.
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
