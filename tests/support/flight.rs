//! A scripted vehicle that speaks the `sitl` profile, a client, and a flight between them: real
//! sockets, frames by rust-mavlink, the X8's model as the aircraft.
#![allow(dead_code)] // each test that includes this module uses its part

use std::net::{SocketAddr, UdpSocket};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use greylag::commands::fly::companion_with;
use greylag::control::ControllerKind;
use greylag::flight::runtime::{self, Flight, FlightOptions, Pace, Summary};
use greylag::model::{GreyBox, Twin};
use greylag::physics::{Command, State};
use mavlink::dialects::ardupilotmega::*;
use mavlink::{MAVLinkV2MessageRaw, MavHeader, Message};

/// Modes as PX4 numbers them in `custom_mode`.
pub const HOLD: u32 = 4 << 16 | 3 << 24;
pub const OFFBOARD: u32 = 6 << 16;
/// Largest step of a surface between two answers: 20 a second at 100 Hz, with 32-bit rounding.
const SLEW: f32 = 0.2 + 1e-6;

/// The model of the simulator.
pub fn x8() -> &'static GreyBox {
    static MODEL: OnceLock<GreyBox> = OnceLock::new();
    MODEL.get_or_init(|| GreyBox::load(Path::new("params/x8/jsbsim.toml")).unwrap())
}

/// FlightOptions that listen on loopback, at ports that the system chooses.
pub fn options(pace: Pace) -> FlightOptions {
    FlightOptions {
        vehicle: "udpin:127.0.0.1:0".parse().unwrap(),
        clients: vec!["udpin:127.0.0.1:0".parse().unwrap(), "tcpin:127.0.0.1:0".parse().unwrap()],
        record: None,
        pace,
        duration: None,
        plan_deadline: FlightOptions::PLAN_DEADLINE,
        travels: x8().airframe.actuators.travels(),
        mixer: None,
        controller: None,
        delay_margin: None,
        signing: None,
    }
}

/// A flight that ends with the test.
pub struct Companion {
    pub flight: Option<Flight>,
    pub stop: Arc<AtomicBool>,
}

impl Companion {
    pub fn start(options: &FlightOptions) -> Self {
        Companion::with(options, companion_with(ControllerKind::Lqi, x8(), Path::new("")).unwrap())
    }

    pub fn with(options: &FlightOptions, companion: runtime::Companion) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        Companion { flight: Some(Flight::start(options, companion, stop.clone()).unwrap()), stop }
    }

    pub fn vehicle(&self) -> SocketAddr {
        self.flight.as_ref().unwrap().vehicle.unwrap()
    }

    pub fn client(&self, link: usize) -> SocketAddr {
        self.flight.as_ref().unwrap().clients[link].unwrap()
    }

    pub fn end(mut self) -> Summary {
        self.stop.store(true, Ordering::Relaxed);
        self.flight.take().unwrap().join().expect("the control thread panicked")
    }
}

impl Drop for Companion {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// A MAVLink 2 frame.
pub fn frame(system: u8, component: u8, message: &MavMessage) -> Vec<u8> {
    let header = MavHeader { system_id: system.into(), component_id: component, sequence: 0 };
    let mut raw = MAVLinkV2MessageRaw::new();
    raw.serialize_message(header, message);
    raw.raw_bytes().to_vec()
}

/// All messages of a datagram.
pub fn messages(mut bytes: &[u8]) -> Vec<MavMessage> {
    let mut found = Vec::new();
    while bytes.len() >= 12 && bytes[0] == 0xFD {
        let id = u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]);
        let (len, end) = (bytes[1] as usize, 12 + bytes[1] as usize);
        if let Ok(message) =
            MavMessage::parse(mavlink::MavlinkVersion::V2, id, &bytes[10..10 + len])
        {
            found.push(message);
        }
        bytes = &bytes[end..];
    }
    found
}

/// One answer of the companion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    pub time_us: u64,
    pub aileron: f32,
    pub elevator: f32,
    pub throttle: f32,
    pub armed: bool,
}

impl Answer {
    fn command(&self) -> Command {
        Command {
            aileron: self.aileron.into(),
            elevator: self.elevator.into(),
            throttle: self.throttle.into(),
            rudder: 0.0,
        }
    }
}

/// What is wrong with the vehicle's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Trouble {
    None,
    /// Nothing is sent.
    Silent,
    /// The body rates are NaN.
    NotANumber,
    /// Ten datagrams of garbage with each frame: flipped bits, cut frames, another system's.
    Garbage,
}

/// The aircraft with its side of the link.
pub struct Vehicle {
    socket: UdpSocket,
    twin: Twin,
    time_us: u64,
    flying: bool,
    pub answers: Vec<Answer>,
}

impl Vehicle {
    pub fn new(companion: SocketAddr) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(companion).unwrap();
        Vehicle {
            socket,
            twin: Twin::new(State::NEUTRAL, 600.0),
            time_us: 0,
            flying: false,
            answers: Vec::new(),
        }
    }

    pub fn state(&self) -> State {
        self.twin.state
    }

    /// The five messages of a state frame.
    fn frames(&self, trouble: Trouble) -> Vec<Vec<u8>> {
        let (s, z) = (self.twin.state, self.twin.actuators.observed(&x8().airframe.actuators));
        let time_usec = self.time_us;
        let mut actuator = [0.0; 32];
        let full = x8().airframe.actuators.aileron.travel.most;
        let scaled = [z.aileron, z.elevator, z.throttle * full, z.aileron_rate, z.elevator_rate];
        actuator.iter_mut().zip(scaled).for_each(|(a, x)| *a = (x / full) as f32);
        let (sr, cr) = (s.roll / 2.0).sin_cos();
        let (sp, cp) = (s.pitch / 2.0).sin_cos();
        let q = if trouble == Trouble::NotANumber { f32::NAN } else { s.q as f32 };
        let air = VFR_HUD_DATA {
            airspeed: s.airspeed as f32,
            alt: self.twin.altitude as f32,
            ..Default::default()
        };
        let attitude = ATTITUDE_QUATERNION_DATA {
            time_boot_ms: (time_usec / 1000) as u32,
            q1: (cr * cp) as f32,
            q2: (sr * cp) as f32,
            q3: (cr * sp) as f32,
            q4: -(sr * sp) as f32,
            rollspeed: s.p as f32,
            pitchspeed: q,
            yawspeed: s.r as f32,
            ..Default::default()
        };
        let incidence = AOA_SSA_DATA {
            time_usec,
            AOA: s.alpha.to_degrees() as f32,
            SSA: s.beta.to_degrees() as f32,
        };
        let imu = HIGHRES_IMU_DATA {
            time_usec,
            zacc: -9.81,
            pressure_alt: self.twin.altitude as f32,
            ..Default::default()
        };
        [
            MavMessage::HIGHRES_IMU(imu),
            MavMessage::VFR_HUD(air),
            MavMessage::AOA_SSA(incidence),
            MavMessage::ACTUATOR_OUTPUT_STATUS(ACTUATOR_OUTPUT_STATUS_DATA {
                time_usec,
                active: 5,
                actuator,
            }),
            MavMessage::ATTITUDE_QUATERNION(attitude),
        ]
        .iter()
        .map(|message| frame(1, 200, message))
        .collect()
    }

    /// Lets 10 ms pass: sends a frame, waits for its answer, flies on it. `None` when there was
    /// no answer within `patience`.
    pub fn step(&mut self, trouble: Trouble, patience: Duration) -> Option<Answer> {
        self.time_us += 10_000;
        if trouble == Trouble::Silent {
            self.fly(self.answers.last().copied());
            return None;
        }
        let frames = self.frames(trouble);
        if trouble == Trouble::Garbage {
            self.send_garbage(&frames);
        }
        self.socket.send(&frames.concat()).unwrap();
        let answer = self.receive(patience);
        self.answers.extend(answer);
        self.fly(answer.or(self.answers.last().copied()));
        answer
    }

    /// Lets 10 ms pass until `end`, whether or not the companion answers: flies on the newest answer there is.
    pub fn step_on(&mut self, end: Instant) {
        self.time_us += 10_000;
        // refused until the companion has opened its port
        let _ = self.socket.send(&self.frames(Trouble::None).concat());
        let mut buffer = [0; 2048];
        while let Some(left) =
            end.checked_duration_since(Instant::now()).filter(|left| !left.is_zero())
        {
            self.socket.set_read_timeout(Some(left)).unwrap();
            let Ok(len) = self.socket.recv(&mut buffer) else { continue };
            self.answers.extend(messages(&buffer[..len]).into_iter().filter_map(answer));
        }
        self.fly(self.answers.last().copied());
    }

    /// Stands still until the first armed answer.
    fn fly(&mut self, answer: Option<Answer>) {
        self.flying |= answer.is_some_and(|a| a.armed);
        if let Some(answer) = answer.filter(|_| self.flying) {
            self.twin.step(x8(), &answer.command());
        }
    }

    fn receive(&self, patience: Duration) -> Option<Answer> {
        let end = Instant::now() + patience;
        let mut buffer = [0; 2048];
        while let Some(left) =
            end.checked_duration_since(Instant::now()).filter(|left| !left.is_zero())
        {
            self.socket.set_read_timeout(Some(left)).unwrap();
            let Ok(len) = self.socket.recv(&mut buffer) else {
                continue;
            };
            let mut answers = messages(&buffer[..len]).into_iter().filter_map(answer);
            if let Some(answer) = answers.rfind(|a| a.time_us == self.time_us) {
                return Some(answer);
            }
        }
        None
    }

    fn send_garbage(&self, frames: &[Vec<u8>]) {
        let whole = frames.concat();
        for i in 0..10 {
            let mut bytes = whole.clone();
            match i % 5 {
                // A flipped bit, wherever it falls, spoils one frame of five.
                0 => bytes[(self.time_us as usize / 7 + 13 * i) % whole.len()] ^= 1 << (i % 8),
                1 => bytes.truncate(self.time_us as usize / 10_000 % whole.len()),
                // Another system's state.
                2 => {
                    bytes =
                        frames.iter().map(|_| frame(9, 200, &tilted())).collect::<Vec<_>>().concat()
                }
                3 => bytes = vec![0xFD; 300],
                _ => bytes.clear(),
            }
            let _ = self.socket.send(&bytes);
        }
    }

    /// Flies on a thread of its own, a frame every 10 ms by the wall, whether or not it is answered.
    pub fn unanswered(mut self) -> WallVehicle {
        let shared = Arc::new((AtomicBool::new(false), AtomicU8::new(Trouble::None as u8)));
        let told = shared.clone();
        let thread = std::thread::spawn(move || {
            let mut next = Instant::now();
            while !told.0.load(Ordering::Relaxed) {
                next = (next + Duration::from_millis(10)).max(Instant::now());
                self.step_on(next);
            }
            self
        });
        WallVehicle { shared, thread }
    }

    /// Flies on a thread of its own, a frame every 10 ms by the wall.
    pub fn on_the_wall(mut self) -> WallVehicle {
        let shared = Arc::new((AtomicBool::new(false), AtomicU8::new(Trouble::None as u8)));
        let told = shared.clone();
        let thread = std::thread::spawn(move || {
            let mut next = Instant::now();
            while !told.0.load(Ordering::Relaxed) {
                let trouble = match told.1.load(Ordering::Relaxed) {
                    1 => Trouble::Silent,
                    2 => Trouble::NotANumber,
                    3 => Trouble::Garbage,
                    _ => Trouble::None,
                };
                self.step(trouble, Duration::from_millis(200));
                next += Duration::from_millis(10);
                std::thread::sleep(next.saturating_duration_since(Instant::now()));
            }
            self
        });
        WallVehicle { shared, thread }
    }
}

/// A bank of 74°, from whom it does not concern.
fn tilted() -> MavMessage {
    MavMessage::ATTITUDE_QUATERNION(ATTITUDE_QUATERNION_DATA {
        q1: 0.8,
        q2: 0.6,
        ..Default::default()
    })
}

fn answer(message: MavMessage) -> Option<Answer> {
    let MavMessage::HIL_ACTUATOR_CONTROLS(m) = message else {
        return None;
    };
    let armed = m.mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
    let [aileron, elevator, throttle, ..] = m.controls;
    Some(Answer { time_us: m.time_usec, aileron, elevator, throttle, armed })
}

/// A vehicle under way.
pub struct WallVehicle {
    shared: Arc<(AtomicBool, AtomicU8)>,
    thread: JoinHandle<Vehicle>,
}

impl WallVehicle {
    pub fn trouble(&self, trouble: Trouble) {
        self.shared.1.store(trouble as u8, Ordering::Relaxed);
    }

    pub fn land(self) -> Vehicle {
        self.shared.0.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

/// Asserts what holds of every sequence of answers: in range, no step beyond the slew limit, all
/// zero when disarmed.
pub fn check_surfaces(answers: &[Answer]) {
    assert!(!answers.is_empty());
    let mut last = [0.0f32; 2];
    for a in answers {
        assert!(
            a.aileron.abs() <= 1.0 && a.elevator.abs() <= 1.0 && (0.0..=1.0).contains(&a.throttle),
            "{a:?}"
        );
        if a.armed {
            let step = (a.aileron - last[0]).abs().max((a.elevator - last[1]).abs());
            assert!(step <= SLEW, "step of {step} at {a:?}");
        } else {
            assert_eq!([a.aileron, a.elevator, a.throttle], [0.0; 3]);
        }
        last = [a.aileron, a.elevator];
    }
}

/// A ground station or offboard program.
pub struct Client {
    socket: Arc<UdpSocket>,
    received: Receiver<MavMessage>,
    stop: Arc<AtomicBool>,
    pub log: Vec<MavMessage>,
    /// The component that commands and setpoints go to; 0 is whoever is the autopilot.
    pub component: u8,
}

impl Client {
    pub fn new(companion: SocketAddr) -> Self {
        let socket = Arc::new(UdpSocket::bind("127.0.0.1:0").unwrap());
        socket.connect(companion).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        let (deliver, received) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let (listening, told) = (socket.clone(), stop.clone());
        std::thread::spawn(move || listen(&listening, &told, &deliver));
        let client = Client { socket, received, stop, log: Vec::new(), component: 0 };
        client.send(&MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_GCS,
            ..Default::default()
        }));
        client
    }

    pub fn send(&self, message: &MavMessage) {
        self.send_bytes(&frame(245, 190, message));
    }

    pub fn send_bytes(&self, bytes: &[u8]) {
        let _ = self.socket.send(bytes);
    }

    pub fn setpoint(&self, roll_deg: f64, pitch_deg: f64) {
        let mut message = setpoint(roll_deg, pitch_deg);
        if let MavMessage::SET_ATTITUDE_TARGET(m) = &mut message
            && self.component != 0
        {
            m.target_component = self.component;
        }
        self.send(&message);
    }

    /// Takes in what has come, waiting until `wanted` is among it; panics after five seconds.
    pub fn wait(&mut self, what: &str, mut wanted: impl FnMut(&MavMessage) -> bool) -> MavMessage {
        let end = Instant::now() + Duration::from_secs(5);
        while let Some(left) = end.checked_duration_since(Instant::now()) {
            if let Ok(message) = self.received.recv_timeout(left) {
                self.log.push(message.clone());
                if wanted(&message) {
                    return message;
                }
            }
        }
        panic!("no {what} within 5 s; heard {:?}", self.texts());
    }

    /// Takes in what has come so far.
    pub fn catch_up(&mut self) {
        self.log.extend(self.received.try_iter());
    }

    /// Sends a command, and gives its result.
    pub fn command(&mut self, command: MavCmd, parameters: [f32; 3]) -> MavResult {
        let [param1, param2, param3] = parameters;
        let order = COMMAND_LONG_DATA {
            command,
            param1,
            param2,
            param3,
            target_system: 1,
            target_component: self.component,
            ..Default::default()
        };
        self.send(&MavMessage::COMMAND_LONG(order));
        let ack = |m: &MavMessage| matches!(m, MavMessage::COMMAND_ACK(a) if a.command == command);
        match self.wait("acknowledgement", ack) {
            MavMessage::COMMAND_ACK(a) => a.result,
            _ => unreachable!(),
        }
    }

    pub fn arm(&mut self) -> MavResult {
        self.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0])
    }

    pub fn mode(&mut self, custom: u32) -> MavResult {
        let (main, sub) = (custom >> 16 & 0xFF, custom >> 24);
        self.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, main as f32, sub as f32])
    }

    /// Waits for a heartbeat that tells this mode.
    pub fn wait_for_mode(&mut self, custom: u32) {
        self.wait(
            "heartbeat in that mode",
            |m| matches!(m, MavMessage::HEARTBEAT(h) if h.custom_mode == custom),
        );
    }

    pub fn wait_for_text(&mut self, part: &str) {
        self.wait(part, |m| matches!(m, MavMessage::STATUSTEXT(t) if t.text.to_str().unwrap_or("").contains(part)));
    }

    pub fn texts(&self) -> Vec<String> {
        let text = |m: &MavMessage| match m {
            MavMessage::STATUSTEXT(t) => Some(t.text.to_str().unwrap_or("").to_owned()),
            _ => None,
        };
        self.log.iter().filter_map(text).collect()
    }

    /// Arms and enters OFFBOARD at a target, as an offboard program does.
    pub fn engage(&mut self, roll_deg: f64, pitch_deg: f64) {
        self.wait(
            "state of the vehicle",
            |m| matches!(m, MavMessage::ATTITUDE(a) if a.roll.is_finite()),
        );
        assert_eq!(self.arm(), MavResult::MAV_RESULT_ACCEPTED);
        self.setpoint(roll_deg, pitch_deg);
        assert_eq!(self.mode(OFFBOARD), MavResult::MAV_RESULT_ACCEPTED);
        self.wait_for_mode(OFFBOARD);
    }

    /// Sends the target at 20 Hz for a while.
    pub fn steer(&self, roll_deg: f64, pitch_deg: f64, seconds: f64) {
        for _ in 0..(20.0 * seconds) as usize {
            self.setpoint(roll_deg, pitch_deg);
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn listen(socket: &UdpSocket, stop: &AtomicBool, deliver: &Sender<MavMessage>) {
    let mut buffer = [0; 2048];
    while !stop.load(Ordering::Relaxed) {
        if let Ok(len) = socket.recv(&mut buffer) {
            for message in messages(&buffer[..len]) {
                let _ = deliver.send(message);
            }
        }
    }
}

/// SET_ATTITUDE_TARGET with yaw zero, rates ignored.
pub fn setpoint(roll_deg: f64, pitch_deg: f64) -> MavMessage {
    let (sr, cr) = (roll_deg.to_radians() / 2.0).sin_cos();
    let (sp, cp) = (pitch_deg.to_radians() / 2.0).sin_cos();
    raw_setpoint([cr * cp, sr * cp, cr * sp, -(sr * sp)])
}

/// SET_ATTITUDE_TARGET with any four numbers as its quaternion.
pub fn raw_setpoint(q: [f64; 4]) -> MavMessage {
    MavMessage::SET_ATTITUDE_TARGET(SET_ATTITUDE_TARGET_DATA {
        q: q.map(|x| x as f32),
        target_system: 1,
        target_component: 1,
        type_mask: AttitudeTargetTypemask::from_bits_retain(1 | 2 | 4 | 64),
        ..Default::default()
    })
}
