//! The link to the companion, which sends and receives bytes and tolerates a missing peer.

mod address;
mod serial;
mod tcp;
mod udp;

pub use address::{Address, AddressError, Transport};

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

use serial::SerialLink;
use tcp::TcpLink;
use udp::UdpLink;

/// Longest wait of a patient receive. The kernel rounds it up to a multiple of its tick, some milliseconds.
const PATIENCE: Duration = Duration::from_millis(10);

/// Whether `receive` waits for data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// Waits for about 10 ms. Used in lockstep, where nothing else is due in that time.
    Patient,
    /// Does not wait. Used in real time, where a wait would delay the next frame.
    Never,
}

/// Why an address could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The host name cannot be resolved to an address.
    #[error("cannot resolve {address}: {source}; give a numeric address such as 127.0.0.1:14600")]
    Resolve {
        /// The address as written.
        address: Address,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Another program uses the port.
    #[error(
        "cannot listen on {address}: the port is in use by another program; stop it or choose another port with --link"
    )]
    InUse {
        /// The address as written.
        address: Address,
    },
    /// A serial port or pseudo-terminal cannot be opened.
    #[error("cannot open {address}: {source}; {remedy}")]
    Serial {
        /// The address as written.
        address: Address,
        /// Error of the operating system.
        source: io::Error,
        /// Advice to the operator.
        remedy: &'static str,
    },
    /// Any other failure of opening the link.
    #[error("cannot open {address}: {source}; check the address given with --link")]
    Open {
        /// The address as written.
        address: Address,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl LinkError {
    fn opening(address: &Address, source: io::Error) -> Self {
        let address = address.clone();
        match source.kind() {
            io::ErrorKind::AddrInUse => LinkError::InUse { address },
            _ => LinkError::Open { address, source },
        }
    }

    fn serial(address: &Address, source: io::Error) -> Self {
        let remedy = match source.kind() {
            io::ErrorKind::AlreadyExists => "that name is taken: choose another, or remove it",
            io::ErrorKind::PermissionDenied => {
                "add your user to the group that owns the device (dialout), then log in again"
            }
            io::ErrorKind::NotFound => "plug the device in, or give the name that it has here",
            io::ErrorKind::InvalidInput => {
                "give a baud rate that the port supports, such as 921600"
            }
            _ => "stop other programs that use it, and check the name given with --link",
        };
        LinkError::Serial { address: address.clone(), source, remedy }
    }
}

/// Received data, or a change of the link itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival<'a> {
    /// Nothing arrived, or nothing within the wait if there is one.
    Nothing,
    /// One datagram from this sender.
    Datagram(&'a [u8], SocketAddr),
    /// Some bytes of the stream.
    Bytes(&'a [u8]),
    /// A stream from this peer has been set up.
    Connected(SocketAddr),
    /// The stream has ended.
    Closed,
}

/// An open link of any transport.
#[derive(Debug)]
pub enum Link {
    /// Link over UDP datagrams.
    Udp(UdpLink),
    /// Link over a TCP stream.
    Tcp(TcpLink),
    /// Link over a serial port or pseudo-terminal.
    Serial(SerialLink),
}

impl Link {
    /// Opens `address`. A missing peer is not an error; a port that cannot be opened is an error.
    pub fn open(address: &Address, wait: Wait) -> Result<Self, LinkError> {
        Ok(match address.transport {
            Transport::UdpIn | Transport::UdpOut => Link::Udp(UdpLink::open(address, wait)?),
            Transport::TcpIn | Transport::TcpOut => Link::Tcp(TcpLink::open(address, wait)?),
            Transport::Serial | Transport::Pty => Link::Serial(SerialLink::open(address, wait)?),
        })
    }

    /// Local address of the link; `None` for a serial link or a stream without connection.
    pub fn local(&self) -> Option<SocketAddr> {
        match self {
            Link::Udp(link) => link.local(),
            Link::Tcp(link) => link.local(),
            Link::Serial(_) => None,
        }
    }

    /// The peer of a UDP link; `None` if it is not yet known, and for a stream.
    pub fn peer(&self) -> Option<SocketAddr> {
        match self {
            Link::Udp(link) => link.peer(),
            Link::Tcp(_) | Link::Serial(_) => None,
        }
    }

    /// Sends a batch of whole frames. Returns `false` if there is no peer, or no room in the send buffer.
    pub fn send(&mut self, bytes: &[u8]) -> bool {
        match self {
            Link::Udp(link) => link.send(bytes),
            Link::Tcp(link) => link.send(bytes),
            Link::Serial(link) => link.send(bytes),
        }
    }

    /// Receives one arrival.
    pub fn receive(&mut self) -> Arrival<'_> {
        match self {
            Link::Udp(link) => link.receive(),
            Link::Tcp(link) => link.receive(),
            Link::Serial(link) => link.receive(),
        }
    }

    /// Sets `sender` as the companion's address: a listening UDP link sends to this address from now on.
    pub fn adopt(&mut self, sender: SocketAddr) {
        if let Link::Udp(link) = self {
            link.adopt(sender);
        }
    }

    /// Releases the silent companion: a listening link then accepts another peer.
    pub fn abandon(&mut self) {
        match self {
            Link::Udp(link) => link.abandon(),
            Link::Tcp(link) => link.abandon(),
            // a serial line has only one other end
            Link::Serial(_) => {}
        }
    }
}
