//! A simulated companion for tests: the other end of the link, over real sockets, with prescribed answers.
#![allow(dead_code)] // Each test that includes this module uses a part of it.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use greylag_sitl::plant::{PlantOptions, Start};
use greylag_sitl::shim::codec::*;
use greylag_sitl::shim::{self, Event, Notice, Pace, ShimError, ShimOptions, Summary};

/// Longest wait of any test.
pub const PATIENCE: Duration = Duration::from_secs(10);

/// Options of a lockstep run towards `link`.
pub fn lockstep(link: &str) -> ShimOptions {
    ShimOptions { pace: Pace::Lockstep, ..real_time(link) }
}

/// Options of a real-time run towards `link`.
pub fn real_time(link: &str) -> ShimOptions {
    let mut options = ShimOptions::new(PlantOptions::default(), Start::NEUTRAL);
    options.link = link.parse().expect(link);
    options
}

/// A shim in a separate thread.
pub struct Shim {
    pub notices: Receiver<Notice>,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<Summary, ShimError>>,
}

impl Shim {
    pub fn start(options: ShimOptions) -> Self {
        let (sender, notices) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            shim::run(&options, &seen, &mut |notice| drop(sender.send(notice)))
        });
        Shim { notices, stop, thread }
    }

    /// Address on which a listening shim listens.
    pub fn address(&self) -> SocketAddr {
        match self.notices.recv_timeout(PATIENCE).expect("an event").event {
            Event::Open(_, Some(address)) => address,
            other => panic!("{other:?} instead of the open link"),
        }
    }

    /// The events since the last call.
    pub fn events(&self) -> Vec<Event> {
        self.notices.try_iter().map(|notice| notice.event).collect()
    }

    pub fn stop(self) -> Summary {
        self.stop.store(true, Ordering::Relaxed);
        self.end()
    }

    pub fn end(self) -> Summary {
        self.thread.join().expect("the shim does not panic").expect("the shim ends well")
    }
}

/// A complete state frame as received.
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    pub imu: HighresImu,
    pub hud: VfrHud,
    pub vanes: AoaSsa,
    pub actuators: ActuatorOutputStatus,
    pub attitude: AttitudeQuaternion,
}

impl State {
    pub fn time_us(&self) -> u64 {
        self.imu.time_usec
    }

    /// Roll, pitch, yaw, rad.
    pub fn euler(&self) -> [f64; 3] {
        let a = &self.attitude;
        let [w, x, y, z] = [a.q1, a.q2, a.q3, a.q4].map(f64::from);
        [
            (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
            (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
            (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
        ]
    }
}

enum Road {
    Udp(UdpSocket, Option<SocketAddr>),
    Tcp(TcpStream),
}

/// The simulated companion.
pub struct Companion {
    road: Road,
    parser: Parser,
    encoder: Encoder,
    waiting: Vec<Frame>,
    /// All received frames of the slower messages.
    pub slow: Vec<Frame>,
    partial: State,
}

impl Companion {
    fn on(road: Road) -> Self {
        Companion {
            road,
            parser: Parser::default(),
            encoder: Encoder::new(1, 1),
            waiting: Vec::new(),
            slow: Vec::new(),
            partial: State::default(),
        }
    }

    /// Listens for datagrams and answers the first sender.
    pub fn udp_in(at: &str) -> Self {
        Self::on(Road::Udp(UdpSocket::bind(at).expect(at), None))
    }

    /// Sends datagrams to `to`.
    pub fn udp_out(to: SocketAddr) -> Self {
        Self::on(Road::Udp(UdpSocket::bind("127.0.0.1:0").expect("any port"), Some(to)))
    }

    pub fn tcp_in(listener: &TcpListener) -> Self {
        let stream = listener.accept().expect("the shim connects").0;
        stream.set_nodelay(true).expect("nodelay");
        Self::on(Road::Tcp(stream))
    }

    pub fn tcp_out(to: SocketAddr) -> Self {
        let stream = TcpStream::connect(to).expect("the shim listens");
        stream.set_nodelay(true).expect("nodelay");
        Self::on(Road::Tcp(stream))
    }

    /// Local address of the companion.
    pub fn address(&self) -> SocketAddr {
        match &self.road {
            Road::Udp(socket, _) => socket.local_addr(),
            Road::Tcp(stream) => stream.local_addr(),
        }
        .expect("an address")
    }

    pub fn send_bytes(&mut self, bytes: &[u8]) {
        match &mut self.road {
            Road::Udp(socket, peer) => {
                socket.send_to(bytes, peer.expect("a peer")).expect("sent");
            }
            Road::Tcp(stream) => stream.write_all(bytes).expect("sent"),
        }
    }

    pub fn send<M: Message>(&mut self, message: &M) {
        let mut bytes = Vec::new();
        self.encoder.encode(message, &mut bytes);
        self.send_bytes(&bytes);
    }

    pub fn heartbeat(&mut self) {
        self.send(&Heartbeat { kind: 1, mavlink_version: 3, ..Heartbeat::default() });
    }

    /// Answers the frame of `time_us`, µs, as an armed companion.
    pub fn answer(&mut self, time_us: u64, command: [f32; 3]) {
        self.send(&answer(time_us, command, 128));
    }

    /// Answers the frame of `time_us`, µs, as a disarmed companion.
    pub fn answer_disarmed(&mut self, time_us: u64) {
        self.send(&answer(time_us, [0.0; 3], 0));
    }

    /// The next state frame; `None` if none is complete within `patience`.
    pub fn state_within(&mut self, patience: Duration) -> Option<State> {
        let until = Instant::now() + patience;
        loop {
            for frame in std::mem::take(&mut self.waiting) {
                // The rest of the batch is dropped. It holds no message of the next state frame.
                if let Some(state) = self.place(&frame) {
                    return Some(state);
                }
            }
            let left = until.checked_duration_since(Instant::now())?;
            self.read(left.max(Duration::from_millis(1)))?;
        }
    }

    /// The next state frame.
    pub fn state(&mut self) -> State {
        self.state_within(PATIENCE).expect("a state frame")
    }

    fn place(&mut self, frame: &Frame) -> Option<State> {
        assert_eq!((frame.system, frame.component), (1, 200));
        let partial = &mut self.partial;
        match frame.id {
            HighresImu::ID => partial.imu = frame.decode()?,
            VfrHud::ID => partial.hud = frame.decode()?,
            AoaSsa::ID => partial.vanes = frame.decode()?,
            ActuatorOutputStatus::ID => partial.actuators = frame.decode()?,
            AttitudeQuaternion::ID => {
                partial.attitude = frame.decode()?;
                return Some(self.partial);
            }
            _ => self.slow.push(*frame),
        }
        None
    }

    fn read(&mut self, patience: Duration) -> Option<()> {
        let mut buffer = [0; 4096];
        let waiting = &mut self.waiting;
        match &mut self.road {
            Road::Udp(socket, peer) => {
                socket.set_read_timeout(Some(patience)).expect("a timeout");
                let (length, from) = socket.recv_from(&mut buffer).ok()?;
                peer.get_or_insert(from);
                self.parser.datagram(&buffer[..length], &mut |frame| waiting.push(frame));
            }
            Road::Tcp(stream) => {
                stream.set_read_timeout(Some(patience)).expect("a timeout");
                // Reads less than one state frame, so no batch completes two.
                let length = stream.read(&mut buffer[..64]).ok().filter(|&n| n > 0)?;
                self.parser.stream(&buffer[..length], &mut |frame| waiting.push(frame));
            }
        }
        Some(())
    }

    /// Number of received byte runs that were not part of a frame.
    pub fn bad(&self) -> u64 {
        self.parser.bad()
    }

    /// Receives `frames` state frames and answers each with the result of `command`.
    pub fn fly(
        &mut self,
        frames: usize,
        mut command: impl FnMut(&State) -> [f32; 3],
    ) -> Vec<State> {
        (0..frames)
            .map(|_| {
                let state = self.state();
                let command = command(&state);
                self.answer(state.time_us(), command);
                state
            })
            .collect()
    }
}

/// An answer to the frame of `time_us`, µs.
pub fn answer(time_us: u64, command: [f32; 3], mode: u8) -> HilActuatorControls {
    let mut controls = [0.0; 16];
    controls[..3].copy_from_slice(&command);
    HilActuatorControls { time_usec: time_us, flags: 0, controls, mode }
}

/// A companion that listens on a free port, and the `udpout:` address of this port for the shim.
pub fn listening() -> (Companion, String) {
    let companion = Companion::udp_in("127.0.0.1:0");
    let link = format!("udpout:{}", companion.address());
    (companion, link)
}
