//! A simulated PX4 as the client of its simulator: TCP with rust-mavlink, by the public protocol.
#![allow(dead_code)] // Each test that includes this module uses a part of it.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use greylag_sitl::plant::{PlantOptions, Start};
use greylag_sitl::shim::{
    self, Event, Notice, Pace, Px4Event, Px4Noise, Px4Options, ShimError, ShimOptions, Summary,
};
use mavlink::dialects::ardupilotmega::*;
use mavlink::{MavHeader, MavlinkVersion, Message as _};

/// Longest wait of any test.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// Step that PX4 expects from its simulators, µs.
pub const STEP_US: u64 = 4_000;
/// Indices, from 0, of the outputs of the stock fixed-wing airframes (PWM_MAIN_FUNC5 to PWM_MAIN_FUNC8).
pub const THROTTLE: usize = 4;
pub const LEFT_AILERON: usize = 5;
pub const RIGHT_AILERON: usize = 6;
pub const ELEVATOR: usize = 7;

/// Options for a run without noise that is as fast as the client answers.
pub fn hurried() -> ShimOptions {
    let mut options = ShimOptions::new(PlantOptions::default(), Start::NEUTRAL);
    options.link = "tcpin:127.0.0.1:0".parse().expect("an address");
    options.pace = Pace::Lockstep;
    options.px4 = Some(Px4Options { noise: Px4Noise::NONE, ..Px4Options::default() });
    options
}

/// A simulator in a separate thread.
pub struct Simulator {
    pub notices: Receiver<Notice>,
    pub address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<Summary, ShimError>>,
}

impl Simulator {
    pub fn start(options: ShimOptions) -> Self {
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

    /// Waits for an event and discards others.
    pub fn until(&self, wanted: impl Fn(&Px4Event) -> bool) -> Px4Event {
        let end = Instant::now() + PATIENCE;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match self.notices.recv_timeout(left).expect("the event").event {
                Event::Px4(event) if wanted(&event) => return event,
                _ => {}
            }
        }
    }

    pub fn stop(self) -> Summary {
        self.stop.store(true, Ordering::Relaxed);
        self.end()
    }

    pub fn end(self) -> Summary {
        self.thread.join().expect("no panic").expect("it ends well")
    }
}

/// All messages of one step.
#[derive(Clone, Debug, Default)]
pub struct Shown {
    pub sensor: HIL_SENSOR_DATA,
    pub gps: Option<HIL_GPS_DATA>,
    pub state: Option<HIL_STATE_QUATERNION_DATA>,
}

/// The simulated PX4.
pub struct Px4 {
    stream: TcpStream,
    held: Vec<u8>,
    sequence: u8,
    /// Time of the first HIL_SENSOR, µs, at which PX4's time is zero.
    first_us: Option<u64>,
    pub flags: u64,
    pub version: MavlinkVersion,
    pub armed: bool,
}

impl Px4 {
    pub fn connect(to: SocketAddr) -> Self {
        let stream = TcpStream::connect(to).expect("connected");
        stream.set_nodelay(true).expect("no delay");
        let (held, version) = (Vec::new(), MavlinkVersion::V2);
        Px4 { stream, held, sequence: 0, first_us: None, flags: 1, version, armed: false }
    }

    /// Connects and sends the first messages of PX4.
    pub fn boot(to: SocketAddr) -> Self {
        let mut px4 = Px4::connect(to);
        px4.ask_for_state(5e3);
        px4.heartbeat(MavAutopilot::MAV_AUTOPILOT_PX4);
        px4
    }

    pub fn heartbeat(&mut self, autopilot: MavAutopilot) {
        self.send(&MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            autopilot,
            mavlink_version: 3,
            ..HEARTBEAT_DATA::DEFAULT
        }));
    }

    pub fn ask_for_state(&mut self, interval_us: f32) {
        self.send(&MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
            param1: 115.0,
            param2: interval_us,
            ..COMMAND_LONG_DATA::DEFAULT
        }));
    }

    pub fn send(&mut self, message: &MavMessage) {
        let header = MavHeader { system_id: 1, component_id: 1, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        mavlink::write_versioned_msg(&mut self.stream, self.version, header, message)
            .expect("sent");
    }

    pub fn send_bytes(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).expect("sent");
    }

    /// The next message; `None` if none arrives within `wait`.
    pub fn receive(&mut self, wait: Duration) -> Option<MavMessage> {
        let end = Instant::now() + wait;
        loop {
            if let Some(message) = self.held_message() {
                return Some(message);
            }
            let left = end.saturating_duration_since(Instant::now());
            self.stream.set_read_timeout(Some(left.max(Duration::from_millis(1)))).expect("set");
            let mut buffer = [0; 4096];
            match self.stream.read(&mut buffer) {
                Ok(0) => panic!("the simulator has closed the connection"),
                Ok(length) => self.held.extend_from_slice(&buffer[..length]),
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    if left.is_zero() {
                        return None;
                    }
                }
                Err(e) => panic!("{e}"),
            }
        }
    }

    /// Removes a complete MAVLink 2 frame from the front of `held` and checks its checksum.
    fn held_message(&mut self) -> Option<MavMessage> {
        let &length = self.held.get(1)?;
        assert_eq!(self.held[0], 0xFD, "every byte belongs to a MAVLink 2 frame");
        let total = usize::from(length) + 12;
        if self.held.len() < total {
            return None;
        }
        let frame: Vec<u8> = self.held.drain(..total).collect();
        let id = u32::from_le_bytes([frame[7], frame[8], frame[9], 0]);
        let sum = mavlink::calculate_crc(&frame[1..total - 2], MavMessage::extra_crc(id));
        assert_eq!(sum.to_le_bytes(), frame[total - 2..], "checksum of message {id}");
        Some(MavMessage::parse(MavlinkVersion::V2, id, &frame[10..total - 2]).expect("known"))
    }

    /// All messages of the next step.
    pub fn shown(&mut self) -> Shown {
        let mut shown = Shown::default();
        loop {
            match self.receive(PATIENCE).expect("a step") {
                MavMessage::HIL_GPS(gps) => shown.gps = Some(gps),
                MavMessage::HIL_STATE_QUATERNION(state) => shown.state = Some(state),
                MavMessage::HIL_SENSOR(sensor) => {
                    self.first_us.get_or_insert(sensor.time_usec);
                    shown.sensor = sensor;
                    return shown;
                }
                MavMessage::COMMAND_ACK(ack) => {
                    assert_eq!(ack.result, MavResult::MAV_RESULT_ACCEPTED);
                }
                other => panic!("{other:?}"),
            }
        }
    }

    /// Sends the controls; `time_us` is the simulator's time, µs.
    pub fn answer(&mut self, time_us: u64, controls: [f32; 16]) {
        let time_usec = time_us - self.first_us.expect("a step before the answer");
        self.answer_at(time_usec, controls);
    }

    /// Sends the controls with a time stamp of the client, µs.
    pub fn answer_at(&mut self, time_usec: u64, controls: [f32; 16]) {
        let mut mode = MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        mode.set(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED, self.armed);
        // As in PX4, the controls are zero when disarmed.
        let controls = if self.armed { controls } else { [0.0; 16] };
        let flags = HilActuatorControlsFlags::from_bits_retain(self.flags);
        self.send(&MavMessage::HIL_ACTUATOR_CONTROLS(HIL_ACTUATOR_CONTROLS_DATA {
            time_usec,
            flags,
            controls,
            mode,
        }));
    }

    /// Receives a step and answers it.
    pub fn step(&mut self, controls: [f32; 16]) -> Shown {
        let shown = self.shown();
        self.answer(shown.sensor.time_usec, controls);
        shown
    }

    /// Receives and answers `steps` steps with zero controls.
    pub fn idle(&mut self, steps: usize) {
        for _ in 0..steps {
            self.step([0.0; 16]);
        }
    }

    /// Arms and answers until JSBSim simulates the flight; returns the last step before.
    pub fn launch(&mut self) -> Shown {
        self.armed = true;
        // 250 answers cover the release and the pull of the catapult; the next step shows the start state.
        (0..250).map(|_| self.step(outputs(0.0, 0.0, 0.5))).last().expect("steps")
    }
}

/// Outputs for roll (right), pitch (up) and throttle, as PX4 allocates them for a conventional aircraft.
pub fn outputs(roll: f32, pitch: f32, throttle: f32) -> [f32; 16] {
    let mut controls = [0.0; 16];
    (controls[LEFT_AILERON], controls[RIGHT_AILERON]) = (-roll, roll);
    (controls[ELEVATOR], controls[THROTTLE]) = (pitch, throttle);
    controls
}

/// Mean and standard deviation.
pub fn statistics(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
}
