//! Peers of a link.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};

/// A link of this program, numbered in the order of opening.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LinkId(pub u16);

/// Placeholder address of the peer on a serial wire, which has none.
pub const SERIAL: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::UNSPECIFIED), 0);

/// One peer on one link: a datagram's sender, one TCP connection, or the end of a serial wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PeerId {
    /// The link on which it was received.
    pub link: LinkId,
    /// Its address and port.
    pub address: SocketAddr,
}

impl fmt::Display for PeerId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.address == SERIAL {
            true => write!(f, "the end of the serial wire (link {})", self.link.0),
            false => write!(f, "{} (link {})", self.address, self.link.0),
        }
    }
}
