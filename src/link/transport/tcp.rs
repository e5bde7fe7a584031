//! TCP links: a listener for several peers, or a connection to one peer that is reopened when it is lost.

use std::collections::HashMap;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc::{Receiver, Sender, WeakSender, channel};
use tokio::time::{sleep, timeout};

use super::{Arrival, Port, count};
use crate::framing::StreamCutter;

/// Largest number of connections of a listening link.
const MAX_CONNECTIONS: usize = 16;
/// Largest number of queued frames for one connection. Further frames are dropped while the peer reads too slowly.
const QUEUE: usize = 256;
/// Largest number of bytes per read. The complete frames of one read are delivered together.
const CHUNK: usize = 1024;
/// Silence after which the rest of an incomplete frame is no longer awaited.
const PARTIAL_FRAME_TIMEOUT: Duration = Duration::from_millis(100);
/// Pause after a failed `accept`, for instance if no file descriptor is free.
const ACCEPT_RETRY: Duration = Duration::from_millis(100);
/// Longest time that a connection attempt may take. A peer that does not accept a frame within this time is disconnected.
const STALLED: Duration = Duration::from_secs(5);
/// Pause before the next connection attempt. It starts at the first value and doubles with each attempt, up to the second.
const BACK_OFF: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(4));

/// The outgoing queues of the open connections, by the peer's address.
type Connections = Arc<Mutex<HashMap<SocketAddr, Sender<Vec<u8>>>>>;

/// Listens for peers at the address `at`. Returns the address that was bound.
pub(super) fn listen(
    port: Port,
    at: SocketAddr,
    outgoing: Receiver<(SocketAddr, Vec<u8>)>,
) -> io::Result<SocketAddr> {
    let listener = std::net::TcpListener::bind(at)?;
    listener.set_nonblocking(true)?;
    let listener = TcpListener::from_std(listener)?;
    let local = listener.local_addr()?;
    let connections = Connections::default();
    tokio::spawn(dispatch(port.clone(), connections.clone(), outgoing));
    tokio::spawn(accept(port, connections, listener));
    Ok(local)
}

/// Connects to `to`, and connects again whenever the connection is lost. The pauses grow as [`BACK_OFF`] states.
pub(super) fn connect(port: Port, to: SocketAddr, outgoing: Receiver<(SocketAddr, Vec<u8>)>) {
    let connections = Connections::default();
    tokio::spawn(dispatch(port.clone(), connections.clone(), outgoing));
    tokio::spawn(async move {
        let mut pause = BACK_OFF.0;
        loop {
            if let Ok(Ok(stream)) = timeout(STALLED, TcpStream::connect(to)).await {
                pause = BACK_OFF.0;
                serve(port.clone(), connections.clone(), stream, to).await;
            }
            sleep(pause).await;
            pause = (pause * 2).min(BACK_OFF.1);
        }
    });
}

async fn accept(port: Port, connections: Connections, listener: TcpListener) {
    loop {
        match listener.accept().await {
            // a connection beyond the limit is closed
            Ok(_) if count_of(&connections) >= MAX_CONNECTIONS => {}
            Ok((stream, from)) => {
                tokio::spawn(serve(port.clone(), connections.clone(), stream, from));
            }
            Err(_) => sleep(ACCEPT_RETRY).await,
        }
    }
}

fn count_of(connections: &Connections) -> usize {
    connections.lock().unwrap_or_else(PoisonError::into_inner).len()
}

/// Serves one connection until it ends.
async fn serve(port: Port, connections: Connections, stream: TcpStream, peer: SocketAddr) {
    // A short frame is sent at once instead of waiting for further bytes. If the option cannot be set, frames are only later.
    let _ = stream.set_nodelay(true);
    let (reading, writing) = stream.into_split();
    let (queue, frames) = channel(QUEUE);
    let own = queue.downgrade();
    connections.lock().unwrap_or_else(PoisonError::into_inner).insert(peer, queue);
    port.announce(Arrival::Opened(port.peer(peer))).await;
    tokio::select! {
        () = read(&port, reading, peer) => {}
        () = write(&port, writing, frames) => {}
    }
    if remove(&connections, peer, &own) {
        port.announce(Arrival::Closed(port.peer(peer))).await;
    }
}

/// Removes the connection of `peer` with the queue `own`, and returns `true`. If `peer` has connected again from the same
/// address, its new connection stays and the result is `false`.
fn remove(connections: &Connections, peer: SocketAddr, own: &WeakSender<Vec<u8>>) -> bool {
    let mut connections = connections.lock().unwrap_or_else(PoisonError::into_inner);
    // if the map no longer contains the queue, no strong sender is left and `upgrade` fails
    let open = own.upgrade();
    let own = connections.get(&peer).zip(open).is_some_and(|(held, own)| held.same_channel(&own));
    if own {
        connections.remove(&peer);
    }
    own
}

/// Reads bytes from the connection and delivers the complete frames, until the connection ends.
async fn read(port: &Port, mut stream: OwnedReadHalf, peer: SocketAddr) {
    let mut cutter = StreamCutter::default();
    let mut chunk = [0; CHUNK];
    loop {
        let mut whole = Vec::new();
        let len = match cutter.is_waiting() {
            true => {
                timeout(PARTIAL_FRAME_TIMEOUT, stream.read(&mut chunk)).await.unwrap_or_else(|_| {
                    cutter.flush_pieces(|frame| whole.extend_from_slice(frame));
                    Err(io::ErrorKind::TimedOut.into())
                })
            }
            false => stream.read(&mut chunk).await,
        };
        match len {
            Ok(0) => return,
            Ok(len) => cutter.push_pieces(&chunk[..len], |frame| whole.extend_from_slice(frame)),
            Err(e) if e.kind() == io::ErrorKind::TimedOut => {}
            Err(_) => return,
        }
        if !whole.is_empty() {
            port.deliver(peer, whole);
        }
    }
}

/// Writes the queued frames. Ends when the peer stops reading or the connection is lost.
async fn write(port: &Port, mut stream: OwnedWriteHalf, mut frames: Receiver<Vec<u8>>) {
    while let Some(frame) = frames.recv().await {
        match timeout(STALLED, stream.write_all(&frame)).await {
            Ok(Ok(())) => count(&port.counters.sent),
            Ok(Err(_)) | Err(_) => return count(&port.counters.send_failed),
        }
    }
}

/// Moves outgoing frames to the queues of their connections. Ends when no sender of `outgoing` is left.
async fn dispatch(
    port: Port,
    connections: Connections,
    mut outgoing: Receiver<(SocketAddr, Vec<u8>)>,
) {
    while let Some((to, frame)) = outgoing.recv().await {
        let queue = connections.lock().unwrap_or_else(PoisonError::into_inner).get(&to).cloned();
        match queue.map(|queue| queue.try_send(frame)) {
            Some(Ok(())) => {}
            Some(Err(_)) => count(&port.counters.outbox_full),
            None => count(&port.counters.send_failed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_connection_that_ends_late_leaves_its_successor_open() {
        let connections = Connections::default();
        let peer = SocketAddr::from(([127, 0, 0, 1], 14550));
        let connect = || {
            let (queue, frames) = channel(1);
            let own = queue.downgrade();
            connections.lock().unwrap().insert(peer, queue);
            (own, frames)
        };
        let (first, _first_frames) = connect();
        let (second, _second_frames) = connect();
        assert!(!remove(&connections, peer, &first), "the successor was removed");
        assert_eq!(count_of(&connections), 1);
        assert!(remove(&connections, peer, &second));
        assert_eq!(count_of(&connections), 0);
    }
}
