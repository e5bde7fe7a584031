//! UDP datagrams to and from the companion.

use std::io;
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};

use super::{Address, Arrival, LinkError, PATIENCE, Transport, Wait};

/// A UDP socket with at most one peer.
#[derive(Debug)]
pub struct UdpLink {
    socket: UdpSocket,
    transport: Transport,
    peer: Option<SocketAddr>,
    buffer: Box<[u8; 65536]>,
}

impl UdpLink {
    pub(super) fn open(address: &Address, wait: Wait) -> Result<Self, LinkError> {
        let resolved = resolve(address)?;
        let opened = match address.transport {
            Transport::UdpOut => connected(resolved),
            _ => UdpSocket::bind(resolved),
        };
        let socket = opened.map_err(|source| LinkError::opening(address, source))?;
        let timed = match wait {
            Wait::Patient => socket.set_read_timeout(Some(PATIENCE)),
            Wait::Never => socket.set_nonblocking(true),
        };
        timed.map_err(|source| LinkError::opening(address, source))?;
        let peer = (address.transport == Transport::UdpOut).then_some(resolved);
        Ok(UdpLink { socket, transport: address.transport, peer, buffer: Box::new([0; 65536]) })
    }

    pub(super) fn local(&self) -> Option<SocketAddr> {
        self.socket.local_addr().ok()
    }

    pub(super) fn peer(&self) -> Option<SocketAddr> {
        self.peer
    }

    pub(super) fn adopt(&mut self, sender: SocketAddr) {
        if self.transport == Transport::UdpIn {
            self.peer = Some(sender);
        }
    }

    pub(super) fn abandon(&mut self) {
        if self.transport == Transport::UdpIn {
            self.peer = None;
        }
    }

    pub(super) fn send(&mut self, bytes: &[u8]) -> bool {
        // The kernel may report the refusal of an earlier datagram at this call. The present datagram is then sent
        // again.
        let mut sent = self.try_send(bytes);
        if sent.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::ConnectionRefused) {
            sent = self.try_send(bytes);
        }
        sent.is_ok()
    }

    fn try_send(&self, bytes: &[u8]) -> io::Result<usize> {
        match (self.transport, self.peer) {
            (Transport::UdpOut, _) => self.socket.send(bytes),
            (_, Some(peer)) => self.socket.send_to(bytes, peer),
            (_, None) => Err(io::ErrorKind::NotConnected.into()),
        }
    }

    pub(super) fn receive(&mut self) -> Arrival<'_> {
        match self.socket.recv_from(&mut self.buffer[..]) {
            Ok((length, sender)) => Arrival::Datagram(&self.buffer[..length], sender),
            // Either the wait timed out, or an earlier datagram was refused because the companion does not run yet.
            Err(_) => Arrival::Nothing,
        }
    }
}

/// A socket on any free port that exchanges datagrams only with `peer`.
fn connected(peer: SocketAddr) -> io::Result<UdpSocket> {
    let any: SocketAddr = if peer.is_ipv6() {
        (std::net::Ipv6Addr::UNSPECIFIED, 0).into()
    } else {
        (std::net::Ipv4Addr::UNSPECIFIED, 0).into()
    };
    let socket = UdpSocket::bind(any)?;
    socket.connect(peer)?;
    Ok(socket)
}

/// The first socket address to which `address` resolves.
pub(super) fn resolve(address: &Address) -> Result<SocketAddr, LinkError> {
    let fail = |source| LinkError::Resolve { address: address.clone(), source };
    let mut found = address.endpoint.to_socket_addrs().map_err(fail)?;
    found.next().ok_or_else(|| fail(io::Error::from(io::ErrorKind::NotFound)))
}
