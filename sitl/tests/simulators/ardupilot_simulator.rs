//! Tests of ArduPilot's JSON interface with a simulated ArduPilot that sends servo packets and reads the states.

use std::net::{SocketAddr, UdpSocket};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::real_time;
use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Start};
use greylag_sitl::shim::{
    self, ArdupilotEvent, ArdupilotOptions, Event, Launch, Notice, ShimError, ShimOptions, Summary,
};
use serde_json::Value;

/// Longest wait of any test.
const PATIENCE: Duration = Duration::from_secs(10);
/// Sufficient wait to detect an unwanted answer.
const MOMENT: Duration = Duration::from_millis(60);
/// Pulse widths for neutral surfaces and closed throttle, µs.
const IDLE: [u16; 4] = [1500, 1500, 1000, 1500];

fn options() -> ShimOptions {
    let mut options = ShimOptions::new(PlantOptions::default(), Start::NEUTRAL);
    options.link = "udpin:127.0.0.1:0".parse().expect("an address");
    options.ardupilot = Some(ArdupilotOptions::default());
    options
}

fn in_flight() -> ShimOptions {
    ShimOptions { launch: Launch::Immediate, ..options() }
}

/// A simulator in a separate thread.
struct Simulator {
    notices: Receiver<Notice>,
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<Summary, ShimError>>,
}

impl Simulator {
    fn start(options: ShimOptions) -> Self {
        let (sender, notices) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            shim::run(&options, &seen, &mut |notice| drop(sender.send(notice)))
        });
        let address = match notices.recv_timeout(PATIENCE).expect("an event").event {
            Event::Open(_, Some(address)) => address,
            other => panic!("{other:?} instead of the open link"),
        };
        Simulator { notices, address, stop, thread }
    }

    /// Waits for an event and discards others; returns the text of the event.
    fn until(&self, wanted: impl Fn(&ArdupilotEvent) -> bool) -> String {
        let end = Instant::now() + PATIENCE;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match self.notices.recv_timeout(left).expect("the event").event {
                Event::Ardupilot(event) if wanted(&event) => return event.to_string(),
                _ => {}
            }
        }
    }

    fn stop(self) -> Summary {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().expect("no panic").expect("it ends well")
    }
}

/// The simulated ArduPilot.
struct ArduPilot {
    socket: UdpSocket,
    magic: u16,
    channels: usize,
    rate_hz: u16,
    count: u32,
}

impl ArduPilot {
    fn new(simulator: &Simulator) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
        socket.connect(simulator.address).expect("connected");
        ArduPilot { socket, magic: 18_458, channels: 16, rate_hz: 1000, count: 0 }
    }

    fn send(&self, pwm: &[u16]) {
        let mut bytes = Vec::new();
        bytes.extend(self.magic.to_le_bytes());
        bytes.extend(self.rate_hz.to_le_bytes());
        bytes.extend(self.count.to_le_bytes());
        for channel in 0..self.channels {
            bytes.extend(pwm.get(channel).copied().unwrap_or(0).to_le_bytes());
        }
        self.socket.send(&bytes).expect("sent");
    }

    fn receive(&self, wait: Duration) -> Option<String> {
        self.socket.set_read_timeout(Some(wait)).expect("set");
        let mut buffer = [0; 4096];
        let length = self.socket.recv(&mut buffer).ok()?;
        Some(String::from_utf8(buffer[..length].to_vec()).expect("text"))
    }

    /// Sends a packet and returns the state in the answer.
    fn step(&mut self, pwm: &[u16]) -> State {
        self.send(pwm);
        let state = State::read(&self.receive(PATIENCE).expect("an answer"));
        self.count += 1;
        state
    }

    fn fly(&mut self, steps: usize, pwm: &[u16]) -> State {
        (0..steps).map(|_| self.step(pwm)).last().expect("steps")
    }
}

/// The values that ArduPilot reads from a line.
#[derive(Clone, Debug, PartialEq)]
struct State {
    timestamp: f64,
    gyro: [f64; 3],
    force: [f64; 3],
    position: [f64; 3],
    velocity: [f64; 3],
    airspeed: f64,
}

impl State {
    fn read(line: &str) -> Self {
        let inner = line.strip_prefix('\n').and_then(|l| l.strip_suffix('\n')).expect("one line");
        assert!(!inner.contains('\n'), "{inner}");
        let value: Value = serde_json::from_str(inner).expect("JSON");
        let number = |value: &Value| value.as_f64().expect("a number");
        let vector = |value: &Value| std::array::from_fn(|i| number(&value[i]));
        State {
            timestamp: number(&value["timestamp"]),
            gyro: vector(&value["imu"]["gyro"]),
            force: vector(&value["imu"]["accel_body"]),
            position: vector(&value["position"]),
            velocity: vector(&value["velocity"]),
            airspeed: number(&value["airspeed"]),
        }
    }
}

/// The state after 0.2 s of flight with these pulse widths, µs.
fn response(pwm: [u16; 4], options: ShimOptions) -> State {
    let simulator = Simulator::start(options);
    let state = ArduPilot::new(&simulator).fly(200, &pwm);
    simulator.stop();
    state
}

#[test]
fn each_channel_acts_with_arduplanes_sign() {
    let aerosonde = || {
        let plant = PlantOptions { aircraft: "aerosonde".to_owned(), ..PlantOptions::default() };
        let start = Start { airspeed_mps: 25.0, ..Start::NEUTRAL };
        ShimOptions { plant, start, ..in_flight() }
    };
    let neutral = response([1500, 1500, 1300, 1500], in_flight());
    // After 0.2 s with a fifth of the travel, the X8 rolls at about 0.3 rad/s and pitches at 0.5 rad/s.
    let right = response([1600, 1500, 1300, 1500], in_flight());
    assert!(right.gyro[0] > neutral.gyro[0] + 0.1, "aileron above its trim rolls right");
    let up = response([1500, 1600, 1300, 1500], in_flight());
    assert!(up.gyro[1] > neutral.gyro[1] + 0.1, "elevator above its trim pitches up");
    let faster = response([1500, 1500, 1900, 1500], in_flight());
    assert!(faster.force[0] > neutral.force[0] + 0.5, "throttle pulls");
    assert!(faster.airspeed > neutral.airspeed, "and accelerates");
    // The X8 has no rudder, so the Aerosonde is used; it yaws at about 0.1 rad/s after 0.2 s.
    let straight = response([1500, 1500, 1300, 1500], aerosonde());
    let yawed = response([1500, 1500, 1300, 1700], aerosonde());
    assert!(yawed.gyro[2] > straight.gyro[2] + 0.02, "rudder above its trim: {yawed:?}");
}

#[test]
fn elevons_move_as_arduplane_mixes_them() {
    let elevons = || {
        let mut options = in_flight();
        let map = "left-elevon=1,right-elevon=2,throttle=3";
        options.ardupilot = Some(ArdupilotOptions {
            outputs: map.parse().expect("a map"),
            ..ArdupilotOptions::default()
        });
        options
    };
    // With MIXING_GAIN 1, ArduPlane's left elevon is elevator minus aileron, and its right elevon is elevator plus aileron. Thus
    // 50 µs of aileron and 100 µs of elevator give 50 µs and 150 µs, which must act like separate channels.
    let mixed = response([1550, 1650, 1300, 1500], elevons());
    let single = response([1550, 1600, 1300, 1500], in_flight());
    assert_eq!(mixed, single);
}

#[test]
fn a_packet_makes_one_step_of_the_plant_of_the_length_that_is_asked_for() {
    let simulator = Simulator::start(in_flight());
    let mut ardupilot = ArduPilot::new(&simulator);
    let plant = PlantOptions { step_s: 0.001, ..PlantOptions::default() };
    let mut plant = Plant::new(&plant).unwrap();
    plant.reset(&Start::NEUTRAL).unwrap();
    // 1200 Hz, ArduPilot's default, is simulated at 1000 Hz; 50 Hz, too slow for its sensors, at 500 Hz.
    for (rate_hz, steps) in [(1200, 1), (500, 2), (50, 2), (1000, 1)] {
        ardupilot.rate_hz = rate_hz;
        let before = plant.truth().time_s;
        let state = ardupilot.step(&[1550, 1480, 1400, 1500]);
        let inputs = Inputs { aileron: 0.1, elevator: 0.04, throttle: 0.4, rudder: 0.0 };
        for _ in 0..steps {
            plant.step(inputs).unwrap();
        }
        let truth = plant.truth();
        assert!((truth.time_s - before - f64::from(steps) * 1e-3).abs() < 1e-9);
        assert!((state.timestamp - truth.time_s).abs() < 1e-9, "{state:?}");
        let rates = [truth.p_radps, truth.q_radps, truth.r_radps];
        for (shown, flown) in [
            (state.gyro, rates),
            (state.force, truth.specific_force_mps2),
            (state.velocity, truth.velocity_ned_mps),
        ] {
            // The conversion to decimal and back may change the last bit.
            assert!(shown.iter().zip(flown).all(|(a, b)| (a - b).abs() <= 1e-14 * b.abs()));
        }
    }
    let summary = simulator.stop();
    assert_eq!((summary.frames, summary.answers, summary.simulated_s), (4, 4, 0.006));
}

#[test]
fn nothing_moves_without_a_packet_and_a_repeated_one_gets_the_last_state_again() {
    let simulator = Simulator::start(in_flight());
    let mut ardupilot = ArduPilot::new(&simulator);
    let last = ardupilot.fly(5, &IDLE);
    assert!(ardupilot.receive(MOMENT).is_none(), "a step without a packet");
    ardupilot.count -= 1;
    assert_eq!(ardupilot.step(&[2000, 2000, 2000, 2000]), last);
    assert!(ardupilot.step(&IDLE).timestamp > last.timestamp);
    let summary = simulator.stop();
    assert_eq!((summary.frames, summary.repeated_frames), (6, 1), "{summary}");
}

#[test]
fn a_count_that_goes_back_is_an_ardupilot_started_again() {
    let simulator = Simulator::start(options());
    let mut ardupilot = ArduPilot::new(&simulator);
    let stand = ardupilot.step(&IDLE);
    assert_eq!(stand.velocity, [0.0; 3], "on its stand while the throttle is closed");
    assert!((stand.force[2] + 9.81).abs() < 0.02, "it feels gravity: {stand:?}");
    // Above 10 % throttle, the catapult pulls for 1 s.
    let flown = ardupilot.fly(1500, &[1500, 1500, 1500, 1500]);
    simulator.until(|e| *e == ArdupilotEvent::Catapult);
    assert!(flown.velocity[0] > 15.0 && flown.position[0] > 5.0, "{flown:?}");
    ardupilot.count = 0;
    let again = ardupilot.step(&IDLE);
    simulator.until(|e| *e == ArdupilotEvent::Restarted);
    assert_eq!(again, stand, "its place and its time");
    simulator.stop();
}

#[test]
fn thirty_two_channels_are_read_and_sixteen_that_do_not_suffice_are_reported() {
    let mut options = in_flight();
    let outputs = "aileron=20,elevator=2,throttle=3".parse().expect("a map");
    options.ardupilot = Some(ArdupilotOptions { outputs, ..ArdupilotOptions::default() });
    let simulator = Simulator::start(options.clone());
    let mut ardupilot = ArduPilot::new(&simulator);
    (ardupilot.magic, ardupilot.channels) = (29_569, 32);
    let mut pwm = [0; 32];
    (pwm[1], pwm[2], pwm[19]) = (1500, 1300, 1600);
    let right = ardupilot.fly(200, &pwm);
    let neutral = response([1500, 1500, 1300, 1500], in_flight());
    assert!(right.gyro[0] > neutral.gyro[0] + 0.1, "channel 20 rolls right");
    simulator.stop();
    let simulator = Simulator::start(options);
    ArduPilot::new(&simulator).step(&IDLE);
    let said = simulator.until(|e| matches!(e, ArdupilotEvent::Missing { .. }));
    assert!(said.contains("channel 20") && said.contains("SERVO_32_ENABLE"), "{said}");
    simulator.stop();
}

#[test]
fn what_is_no_servo_packet_moves_nothing_and_is_said_once() {
    let simulator = Simulator::start(in_flight());
    let mut ardupilot = ArduPilot::new(&simulator);
    let before = ardupilot.step(&IDLE);
    for garbage in [&b"\xFD not a packet"[..], &[0x1A, 0x48], &[0; 40], &[]] {
        ardupilot.socket.send(garbage).expect("sent");
    }
    assert!(ardupilot.receive(MOMENT).is_none(), "an answer to garbage");
    assert!((ardupilot.step(&IDLE).timestamp - before.timestamp - 0.001).abs() < 1e-9);
    let said = simulator.until(|e| matches!(e, ArdupilotEvent::Garbage(..)));
    assert!(said.contains("no servo packet") && !said.contains('\n'), "{said}");
    let more = simulator.notices.try_iter().map(|n| n.event.to_string());
    assert_eq!(more.filter(|words| words.contains("no servo packet")).count(), 0, "said once");
    assert_eq!(simulator.stop().bad_frames, 4);
}

fn a_silent_ardupilot_is_said_and_another_may_take_its_place() {
    let simulator = Simulator::start(in_flight());
    let mut first = ArduPilot::new(&simulator);
    first.fly(20, &IDLE);
    let mut second = ArduPilot::new(&simulator);
    second.send(&IDLE);
    assert!(second.receive(MOMENT).is_none(), "turned away while the first is alive");
    simulator.until(|e| matches!(e, ArdupilotEvent::Second(_)));
    simulator.until(|e| *e == ArdupilotEvent::Stopped);
    let state = first.step(&IDLE);
    assert!((state.timestamp - 0.021).abs() < 1e-9, "it goes on where it stood: {state:?}");
    simulator.until(|e| *e == ArdupilotEvent::Resumed);
    simulator.until(|e| *e == ArdupilotEvent::Stopped);
    assert!((second.step(&IDLE).timestamp - 0.001).abs() < 1e-9, "a flight of its own");
    simulator.stop();
}

#[test]
fn what_cannot_be_is_refused_before_anything_is_opened() {
    let refused = |change: fn(&mut ShimOptions), words: &str| {
        let mut options = options();
        change(&mut options);
        let stopped = AtomicBool::new(true);
        let run = shim::run(&options, &stopped, &mut |_| panic!("it has begun"));
        let error = run.expect_err("refused").to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{error}");
    };
    refused(|o| o.link = "tcpin:127.0.0.1:0".parse().unwrap(), "udpin");
    refused(|o| o.faults.drop_probability = 0.1, "SIM_*");
    refused(|o| o.personality = Some(shim::Personality::Ardupilot), "--personality");
}

#[test]
fn the_program_says_what_it_waits_for_and_names_bad_options() {
    let sitl = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_greylag-sitl"));
        command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    for (arguments, named) in [
        (&["--ardupilot-sim", "--ardupilot-outputs", "aileron=1"][..], "pitch is moved by nothing"),
        (&["--ardupilot-sim", "--ardupilot-pwm", "2000:1500:1000"], "must grow"),
        (&["--ardupilot-sim", "--px4-sim"], "px4-sim"),
        (&["--ardupilot-pwm", "1000:1500:2000"], "ardupilot-sim"),
    ] {
        let output = sitl(arguments).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && errors.contains(named), "{arguments:?}: {errors}");
    }
    let mut child = sitl(&["--ardupilot-sim", "udpin:127.0.0.1:0"]).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(800));
    child.kill().unwrap();
    let said = child.wait_with_output().unwrap().stdout;
    let said = String::from_utf8_lossy(&said);
    let line = "arduplane --model JSON:127.0.0.1 --home 46.8,0,600,0";
    assert!(said.contains("waiting for servo packets") && said.contains(line), "{said}");
}

real_time::tests!(a_silent_ardupilot_is_said_and_another_may_take_its_place,);
