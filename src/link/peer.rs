//! Identifiers of links and of the peers on them.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};

/// Number of a link of this program, in the order of opening.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LinkId(pub u16);

/// Placeholder for the address of the peer on a serial port, which has no address.
pub const SERIAL: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::UNSPECIFIED), 0);

/// One peer on one link: the sender of datagrams, a TCP connection, or the device on a serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PeerId {
    /// The link on which the peer is reached.
    pub link: LinkId,
    /// Address and port of the peer.
    pub address: SocketAddr,
}

impl fmt::Display for PeerId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.address == SERIAL {
            true => write!(f, "the device on the serial port (link {})", self.link.0),
            false => write!(f, "{} (link {})", self.address, self.link.0),
        }
    }
}
