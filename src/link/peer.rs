//! Who is at the other end of a link.

use std::fmt;
use std::net::SocketAddr;

/// A link of this program, numbered in the order of opening.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LinkId(pub u16);

/// One correspondent on one link: a datagram's sender, or one TCP connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PeerId {
    /// The link it was heard on.
    pub link: LinkId,
    /// Its own address and port.
    pub address: SocketAddr,
}

impl fmt::Display for PeerId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (link {})", self.address, self.link.0)
    }
}
