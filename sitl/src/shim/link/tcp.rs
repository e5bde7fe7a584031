//! TCP byte stream to and from the companion; a lost connection is set up again.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

use super::udp::resolve;
use super::{Address, Arrival, LinkError, PATIENCE, Transport, Wait};

/// Time between attempts to connect, and between checks of a listener for new connections.
const RETRY: Duration = Duration::from_millis(100);
/// Longest time of one attempt to connect.
const CONNECT: Duration = Duration::from_secs(2);

/// Origin of the connections.
#[derive(Debug)]
enum Source {
    Listener(TcpListener),
    /// Connects in a separate thread, because a slow network must not delay a cycle.
    Connector {
        to: SocketAddr,
        attempt: Option<Receiver<io::Result<TcpStream>>>,
    },
}

/// A TCP link with at most one connection at a time.
#[derive(Debug)]
pub struct TcpLink {
    source: Source,
    wait: Wait,
    stream: Option<TcpStream>,
    /// The unsent rest of a batch. It is sent before other bytes, because a frame must not be split.
    unsent: Vec<u8>,
    /// Whether the companion on the present connection is silent.
    silent: bool,
    closed: bool,
    next_look: Instant,
    buffer: Box<[u8; 65536]>,
}

impl TcpLink {
    pub(super) fn open(address: &Address, wait: Wait) -> Result<Self, LinkError> {
        let resolved = resolve(address)?;
        let source = match address.transport {
            Transport::TcpIn => listen(resolved)
                .map(Source::Listener)
                .map_err(|source| LinkError::opening(address, source))?,
            _ => Source::Connector { to: resolved, attempt: None },
        };
        Ok(TcpLink {
            source,
            wait,
            stream: None,
            unsent: Vec::new(),
            silent: false,
            closed: false,
            next_look: Instant::now(),
            buffer: Box::new([0; 65536]),
        })
    }

    pub(super) fn local(&self) -> Option<SocketAddr> {
        match (&self.source, &self.stream) {
            (Source::Listener(listener), _) => listener.local_addr().ok(),
            (_, Some(stream)) => stream.local_addr().ok(),
            _ => None,
        }
    }

    pub(super) fn abandon(&mut self) {
        self.silent = true;
    }

    pub(super) fn send(&mut self, bytes: &[u8]) -> bool {
        let Some(stream) = &mut self.stream else {
            return false;
        };
        let outcome = flush(stream, &mut self.unsent).and_then(|()| {
            if !self.unsent.is_empty() {
                return Ok(false);
            }
            self.unsent.extend_from_slice(bytes);
            flush(stream, &mut self.unsent).map(|()| true)
        });
        outcome.unwrap_or_else(|_| {
            self.close();
            false
        })
    }

    fn close(&mut self) {
        self.closed |= self.stream.take().is_some();
        self.unsent.clear();
        self.next_look = Instant::now() + RETRY;
    }

    pub(super) fn receive(&mut self) -> Arrival<'_> {
        if self.closed {
            self.closed = false;
            return Arrival::Closed;
        }
        if let Some(peer) = self.look() {
            return Arrival::Connected(peer);
        }
        let Some(stream) = &mut self.stream else {
            if self.wait == Wait::Patient {
                thread::sleep(PATIENCE);
            }
            return Arrival::Nothing;
        };
        match stream.read(&mut self.buffer[..]) {
            Ok(0) => self.ended(),
            Ok(length) => {
                self.silent = false;
                Arrival::Bytes(&self.buffer[..length])
            }
            Err(error) if is_lull(&error) => Arrival::Nothing,
            Err(_) => self.ended(),
        }
    }

    fn ended(&mut self) -> Arrival<'static> {
        self.close();
        self.closed = false;
        Arrival::Closed
    }

    /// Looks for a new connection, at most once every `RETRY`.
    fn look(&mut self) -> Option<SocketAddr> {
        let now = Instant::now();
        if now < self.next_look {
            return None;
        }
        self.next_look = now + RETRY;
        let wanted = self.stream.is_none() || self.silent;
        let fresh = match &mut self.source {
            // While the companion is alive, a further connection is closed at once.
            Source::Listener(listener) => listener.accept().ok()?.0,
            Source::Connector { .. } if self.stream.is_some() => return None,
            Source::Connector { to, attempt } => arrived(*to, attempt)?,
        };
        if !wanted {
            return None;
        }
        let peer = fresh.peer_addr().ok()?;
        self.prepare(&fresh).ok()?;
        self.unsent.clear();
        self.silent = false;
        self.stream = Some(fresh);
        Some(peer)
    }

    fn prepare(&self, stream: &TcpStream) -> io::Result<()> {
        stream.set_nodelay(true)?;
        match self.wait {
            Wait::Never => stream.set_nonblocking(true),
            Wait::Patient => {
                stream.set_nonblocking(false)?;
                stream.set_read_timeout(Some(PATIENCE))?;
                stream.set_write_timeout(Some(PATIENCE))
            }
        }
    }
}

fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// The connection of a finished attempt, if it succeeded; begins an attempt if none runs.
fn arrived(
    to: SocketAddr,
    attempt: &mut Option<Receiver<io::Result<TcpStream>>>,
) -> Option<TcpStream> {
    let Some(running) = attempt else {
        let (sender, receiver) = channel();
        let connect = move || sender.send(TcpStream::connect_timeout(&to, CONNECT));
        thread::Builder::new().name("connect".into()).spawn(connect).ok()?;
        *attempt = Some(receiver);
        return None;
    };
    match running.try_recv() {
        Err(TryRecvError::Empty) => None,
        Ok(outcome) => {
            *attempt = None;
            outcome.ok()
        }
        Err(TryRecvError::Disconnected) => {
            *attempt = None;
            None
        }
    }
}

/// Writes as much of `unsent` as possible and keeps the rest.
pub(super) fn flush(stream: &mut impl Write, unsent: &mut Vec<u8>) -> io::Result<()> {
    while !unsent.is_empty() {
        match stream.write(unsent) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(written) => drop(unsent.drain(..written)),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) if is_lull(&error) => return Ok(()),
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Whether an error is temporary: would block, timed out or interrupted.
pub(super) fn is_lull(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}
