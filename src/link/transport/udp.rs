//! UDP links: one socket for any number of peers.
//!
//! The socket is never connected to a peer. An unreachable peer (ICMP port unreachable) therefore does not disturb the
//! other peers, and a peer may send from another port than the one at which it receives.

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::net::UdpSocket;
use tokio::sync::mpsc::Receiver;

use super::flood::Senders;
use super::{Port, count};

/// Largest accepted datagram, bytes: an Ethernet jumbo frame. MAVLink senders stay within a normal Ethernet frame.
const MAX_DATAGRAM: usize = 9000;
/// Delay after an error of receiving. It prevents a busy loop on a persistent error.
const ERROR_DELAY: Duration = Duration::from_millis(5);

/// Opens a socket at the address `at` for receiving and sending. Returns the bound address.
pub(super) fn listen(
    port: Port,
    at: SocketAddr,
    outgoing: Receiver<(SocketAddr, Vec<u8>)>,
) -> io::Result<SocketAddr> {
    serve(port, std::net::UdpSocket::bind(at)?, outgoing)
}

/// Opens a socket at a free port, from which the address `to` can be reached. Returns the bound address.
pub(super) fn reach(
    port: Port,
    to: SocketAddr,
    outgoing: Receiver<(SocketAddr, Vec<u8>)>,
) -> io::Result<SocketAddr> {
    // A socket for a peer on this machine is bound to a loopback address, so that other machines cannot reach it.
    let from: SocketAddr = match (to, to.ip().is_loopback()) {
        (SocketAddr::V4(_), true) => (Ipv4Addr::LOCALHOST, 0).into(),
        (SocketAddr::V4(_), false) => (Ipv4Addr::UNSPECIFIED, 0).into(),
        (SocketAddr::V6(_), true) => (Ipv6Addr::LOCALHOST, 0).into(),
        (SocketAddr::V6(_), false) => (Ipv6Addr::UNSPECIFIED, 0).into(),
    };
    let socket = std::net::UdpSocket::bind(from)?;
    socket.set_broadcast(true)?;
    serve(port, socket, outgoing)
}

fn serve(
    port: Port,
    socket: std::net::UdpSocket,
    outgoing: Receiver<(SocketAddr, Vec<u8>)>,
) -> io::Result<SocketAddr> {
    socket.set_nonblocking(true)?;
    let socket = Arc::new(UdpSocket::from_std(socket)?);
    let local = socket.local_addr()?;
    tokio::spawn(send(port.clone(), socket.clone(), outgoing));
    tokio::spawn(receive(port, socket));
    Ok(local)
}

async fn receive(port: Port, socket: Arc<UdpSocket>) {
    // one byte more than the largest accepted datagram, to detect longer datagrams
    let mut buffer = vec![0; MAX_DATAGRAM + 1];
    let mut senders = Senders::default();
    loop {
        match socket.recv_from(&mut buffer).await {
            Ok((_, from)) if !port.takes_all && !senders.may(from, Instant::now()) => {
                count(&port.counters.flooded)
            }
            Ok((len, _)) if len > MAX_DATAGRAM => count(&port.counters.oversize),
            Ok((len, from)) => port.deliver(from, buffer[..len].to_vec()),
            Err(_) => tokio::time::sleep(ERROR_DELAY).await,
        }
    }
}

/// Sends the frames of the queue `outgoing`. Ends when all senders of the queue are dropped.
async fn send(port: Port, socket: Arc<UdpSocket>, mut outgoing: Receiver<(SocketAddr, Vec<u8>)>) {
    while let Some((to, frame)) = outgoing.recv().await {
        match socket.send_to(&frame, to).await {
            Ok(_) => count(&port.counters.sent),
            Err(_) => count(&port.counters.send_failed),
        }
    }
}
