//! A simulated flight controller: the response of PX4 or ArduPilot to a companion's messages.
//!
//! The controller takes and returns bytes and steps by 10 ms. It has no socket and no clock, so a companion in the same process
//! can fly with it in lockstep. The simulation covers what a companion depends on: identities, modes and their rules, streams on
//! request, the parameter server, the sampling of sticks, timeouts, and the stack's attitude loops. State estimation is perfect
//! except for the sensor errors of the options.

mod ardupilot_failsafe;
mod connect;
mod lag;
mod law;
mod modes;
mod parameters;
pub(super) mod real_time;
mod sticks;
mod streams;

use std::fmt;

use super::codec::{
    CommandAck, CommandLong, Encoder, FileTransferProtocol, Frame, Heartbeat, ManualControl,
    ParamRequestList, ParamRequestRead, ParamSet, Parser, RcChannelsOverride, SetAttitudeTarget,
    StatusText, TimeSync,
};
use super::distortion::{Distorter, Distortion};
use super::error::ShimError;
use super::flight::{Flight, Over};
use super::options::ShimOptions;
use super::telemetry::StateFrame;
use crate::plant::{Inputs, Truth};
use ardupilot_failsafe::{Failsafes, Seen};
use lag::Lag;
use law::Law;
pub use modes::Mode;
use parameters::Table;
use sticks::Sticks;
use streams::{Equipment, Streams};

/// System ID of the simulated controller.
pub const SYSTEM: u8 = 1;
/// Component ID MAV_COMP_ID_AUTOPILOT1.
const COMPONENT: u8 = 1;
/// ArduPilot reads its channels every second step: 50 Hz.
const SAMPLE_EVERY: u64 = 2;
/// PX4's commander checks the requirements of its modes every tenth step: 10 Hz.
const LOOK_EVERY: u64 = 10;
/// Least time from the first stick message until PX4's commander allows MANUAL, s, because another module forwards the sticks.
/// Real PX4 refused MANUAL 150 ms after the first stick message in two of three requests, and never after 300 ms.
const STICKS_SEEN_S: f64 = 0.15;
/// Pulse widths of roll, pitch and throttle from an RC transmitter with released sticks and idle throttle, µs.
const RADIO_US: [u16; 3] = [1500, 1500, 1000];
/// Sensor bit MAV_SYS_STATUS_SENSOR_RC_RECEIVER.
const RECEIVER: u32 = 1 << 16;
/// Bank angle at which ArduPilot turns back to the place where GUIDED was entered, rad; 45° to 55° were observed.
const TURN_BACK: f64 = 50.0 * std::f64::consts::PI / 180.0;

/// Flight stack whose behaviour is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Personality {
    /// PX4 with a fixed-wing airframe.
    Px4,
    /// ArduPilot's fixed-wing firmware, ArduPlane.
    Ardupilot,
}

impl fmt::Display for Personality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Personality::Px4 => "PX4",
            Personality::Ardupilot => "ArduPilot",
        })
    }
}

/// Counts of the simulated controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Accepted stick messages or channel overrides.
    pub sticks: u64,
    /// Accepted attitude targets.
    pub targets: u64,
    /// Ignored control messages: wrong sender, wrong addressee, or not accepted in this mode.
    pub ignored: u64,
    /// Mode changes by a failsafe.
    pub failsafes: u64,
    /// Stream requests that were denied because of their rate.
    pub denied: u64,
}

/// An attitude setpoint (rad) with its thrust (0..1) and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Setpoint {
    at_us: u64,
    roll: f64,
    pitch: f64,
    thrust: Option<f64>,
}

const HEARTBEAT: u32 = 0;

/// The simulated flight controller with the aircraft that it flies.
pub struct FlightController {
    personality: Personality,
    flight: Flight,
    parser: Parser,
    encoder: Encoder,
    streams: Streams,
    parameters: Table,
    law: Law,
    lag: Lag,
    distorter: Distorter,
    sticks: Sticks,
    /// Time of the last heartbeat of the system that ArduPilot regards as its ground station, µs.
    station_us: Option<u64>,
    failsafes: Failsafes,
    /// Commands at which aileron and elevator are jammed; `None` for a surface that is not jammed.
    jammed: [Option<f64>; 2],
    setpoint: Option<Setpoint>,
    mode: Mode,
    armed: bool,
    /// Latitude and longitude of the start, degrees.
    home: Option<(f64, f64)>,
    entered_us: u64,
    /// Whether PX4's last check found the requirements of MANUAL met.
    manual_allowed: bool,
    steps: u64,
    now_us: u64,
    measured: Truth,
    inputs: Inputs,
    /// Last command, before the delay of the servos.
    commanded: Inputs,
    /// Bytes that wait to be sent with the next step.
    waiting: Vec<u8>,
    /// Counts of accepted and ignored messages.
    pub counts: Counts,
}

impl FlightController {
    /// A controller in an autonomous mode, armed and in the air, with the aircraft of the options.
    ///
    /// # Errors
    /// If the aircraft cannot be loaded, the truth file cannot be created, or an option names a parameter that the stack does not
    /// have.
    pub fn new(personality: Personality, options: &ShimOptions) -> Result<Self, ShimError> {
        FlightController::with(personality, Flight::new(options)?, &options.parameters)
    }

    /// Whether the simulated stack `personality` has the parameter `name`.
    pub fn plays(personality: Personality, name: &str) -> bool {
        Table::has(personality, name)
    }

    pub(super) fn with(
        personality: Personality,
        mut flight: Flight,
        changed: &[(String, f64)],
    ) -> Result<Self, ShimError> {
        flight.launch();
        let travel = flight.travel();
        let parameters = Table::new(personality, changed)?;
        let receiver = if parameters.get("SIM_RC_FAIL") == 0.0 { RECEIVER } else { 0 };
        Ok(FlightController {
            personality,
            flight,
            parser: Parser::default(),
            encoder: Encoder::new(SYSTEM, COMPONENT),
            streams: Streams::new(Equipment { travel, receiver }),
            parameters,
            law: Law::new(personality, travel),
            lag: Lag::default(),
            distorter: Distorter::default(),
            sticks: Sticks::default(),
            station_us: None,
            failsafes: Failsafes::default(),
            jammed: [None; 2],
            setpoint: None,
            mode: Mode::Hold,
            armed: true,
            home: None,
            entered_us: 0,
            manual_allowed: false,
            steps: 0,
            now_us: 0,
            measured: Truth::default(),
            inputs: Inputs::default(),
            commanded: Inputs::default(),
            waiting: Vec::new(),
            counts: Counts::default(),
        })
    }

    /// Samples the sensors and appends the frames that are due to `out`.
    pub fn show(&mut self, out: &mut Vec<u8>) {
        let (frame, measured) = self.flight.measure();
        (self.now_us, self.measured) = (frame.time_us, measured);
        self.home.get_or_insert((measured.latitude_deg, measured.longitude_deg));
        out.append(&mut self.waiting);
        if self.steps.is_multiple_of(100) {
            let heartbeat = self.heartbeat();
            self.encoder.encode(&heartbeat, out);
        }
        // The controller's attitude loops use the undistorted measurement; only messages are distorted.
        let cutoff = match self.personality {
            Personality::Px4 => self.parameters.get("IMU_GYRO_CUTOFF"),
            Personality::Ardupilot => self.parameters.get("INS_GYRO_FILTER"),
        };
        let filtered = self.lag.filtered(measured, cutoff);
        let (sent_us, sent) = self.distorter.apply(frame.time_us, filtered);
        let frame = StateFrame::new(sent_us, &sent, self.flight.travel());
        self.streams.send(&frame, &sent, self.flight.home_m(), &mut self.encoder, out);
        self.steps += 1;
    }

    /// Sets the distortion of the measurements that the companion receives from now on.
    pub fn distort(&mut self, distortion: Distortion) {
        self.distorter.now = distortion;
    }

    /// Parses and executes received messages.
    pub fn receive(&mut self, bytes: &[u8]) {
        let mut frames = Vec::new();
        self.parser.stream(bytes, &mut |frame| frames.push(frame));
        frames.iter().for_each(|frame| self.take(frame));
    }

    /// Discards an unfinished frame, as after a break of the link.
    pub fn restart_stream(&mut self) {
        self.parser.restart();
    }

    /// Makes one step with the messages received so far. Returns why the flight is over; `None` if it continues.
    ///
    /// # Errors
    /// If the plant cannot be stepped, or the truth file cannot be written.
    pub fn fly(&mut self) -> Result<Option<Over>, ShimError> {
        self.watch();
        self.commanded = self.command();
        // PX4 does not have this parameter: its value is NaN, which gives no delay.
        let inputs = self.lag.delayed(self.commanded, self.parameters.get("SIM_SERVO_DELAY"));
        let inputs = Inputs {
            aileron: self.jammed[0].unwrap_or(inputs.aileron),
            elevator: self.jammed[1].unwrap_or(inputs.elevator),
            ..inputs
        };
        self.inputs = if self.armed { inputs } else { Inputs::default() };
        self.flight.advance(self.inputs)
    }

    /// The present mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// The last command of the actuators, after delay and jams.
    pub fn inputs(&self) -> Inputs {
        self.inputs
    }

    /// Last measurement; it is the truth if the options set no sensor errors.
    pub fn measured(&self) -> Truth {
        self.measured
    }

    /// Simulated time of the last step, µs.
    pub fn now_us(&self) -> u64 {
        self.now_us
    }

    /// Changes a parameter as a ground station would; an unknown name has no effect.
    pub fn set_parameter(&mut self, name: &str, value: f64) {
        self.parameters.put(name, value);
    }

    /// Jams the aileron at its present command.
    pub fn jam_aileron(&mut self) {
        self.jammed[0] = Some(self.inputs.aileron);
    }

    /// Jams the elevator at its present command.
    pub fn jam_elevator(&mut self) {
        self.jammed[1] = Some(self.inputs.elevator);
    }

    /// Arms or disarms the controller as a pilot would.
    pub fn arm(&mut self, armed: bool) {
        self.armed = armed;
    }

    /// Changes the mode as a pilot would.
    pub fn set_mode(&mut self, mode: Mode) {
        if self.mode != mode {
            self.law.begin(self.mode == Mode::Manual);
            (self.mode, self.entered_us) = (mode, self.now_us);
            let heartbeat = self.heartbeat();
            self.encoder.encode(&heartbeat, &mut self.waiting);
        }
    }

    pub(super) fn flight(&mut self) -> &mut Flight {
        &mut self.flight
    }

    pub(super) fn bad_frames(&self) -> u64 {
        self.parser.bad()
    }

    fn heartbeat(&self) -> Heartbeat {
        Heartbeat {
            custom_mode: self.mode.number(self.personality),
            kind: 1,
            autopilot: match self.personality {
                Personality::Px4 => 12,
                Personality::Ardupilot => 3,
            },
            // Custom mode enabled; armed.
            base_mode: 1 | if self.armed { 128 } else { 0 },
            system_status: if self.armed { 4 } else { 3 },
            mavlink_version: 3,
        }
    }

    fn take(&mut self, frame: &Frame) {
        let for_us = |system: u8, component: u8| {
            matches!(system, 0 | SYSTEM) && matches!(component, 0 | COMPONENT)
        };
        if frame.id == HEARTBEAT && f64::from(frame.system) == self.parameters.get("MAV_GCS_SYSID")
        {
            self.station_us = Some(self.now_us);
        }
        if let Some(m) =
            frame.decode::<CommandLong>().filter(|m| for_us(m.target_system, m.target_component))
        {
            self.obey(frame, &m);
        } else if let Some(m) = frame.decode::<ManualControl>() {
            self.manual_control(&m);
        } else if let Some(m) = frame.decode::<RcChannelsOverride>() {
            self.channels_override(frame.system, &m);
        } else if let Some(m) = frame.decode::<SetAttitudeTarget>() {
            self.attitude_target(&m);
        } else if let Some(m) = frame
            .decode::<ParamRequestRead>()
            .filter(|m| for_us(m.target_system, m.target_component))
        {
            self.parameters.read(&m, &mut self.encoder, &mut self.waiting);
        } else if frame
            .decode::<ParamRequestList>()
            .is_some_and(|m| for_us(m.target_system, m.target_component))
        {
            self.parameters.list(&mut self.encoder, &mut self.waiting);
        } else if let Some(m) =
            frame.decode::<ParamSet>().filter(|m| for_us(m.target_system, m.target_component))
        {
            self.parameters.set(&m, &mut self.encoder, &mut self.waiting);
        } else if let Some(m) = frame
            .decode::<FileTransferProtocol>()
            .filter(|m| for_us(m.target_system, m.target_component))
        {
            self.refuse_file(frame, &m);
        } else if self.mission(frame) {
            // `mission` has answered the frame.
        } else if let Some(m) = frame.decode::<TimeSync>().filter(|m| m.tc1 == 0) {
            let tc1 = (self.now_us as i64).saturating_mul(1000);
            self.encoder.encode(&TimeSync { tc1, ..m }, &mut self.waiting);
        }
    }

    fn obey(&mut self, frame: &Frame, m: &CommandLong) {
        let requested = connect::requested(m.command, &m.param);
        let result = match m.command {
            _ if requested.is_some() => requested.map_or(3, |r| self.grants(r)),
            176 => {
                if self.personality == Personality::Px4 {
                    // PX4's MAVLink receiver acknowledges the command before its commander does.
                    self.acknowledge(frame, m.command, 0);
                }
                self.asked_for_mode(m.param[1], m.param[2])
            }
            400 => {
                self.armed = m.param[0] == 1.0;
                0
            }
            511 => {
                let denied = match self.personality {
                    Personality::Px4 => f64::INFINITY,
                    // ArduPilot sends a stream at no more than 0.8 of the scheduler's rate.
                    Personality::Ardupilot => 0.8 * self.parameters.get("SCHED_LOOP_RATE"),
                };
                let result = self.streams.set(m.param[0] as u32, m.param[1], denied);
                if result == streams::DENIED {
                    self.counts.denied += 1;
                    self.send_text(3, b"Requested rate too fast");
                }
                result
            }
            // MAV_RESULT_UNSUPPORTED.
            _ => 3,
        };
        self.acknowledge(frame, m.command, result);
        if let Some(requested) = requested.filter(|_| result == 0) {
            self.send_requested(requested);
        }
    }

    fn acknowledge(&mut self, frame: &Frame, command: u16, result: u8) {
        let ack = CommandAck {
            command,
            result,
            target_system: frame.system,
            target_component: frame.component,
            ..CommandAck::default()
        };
        self.encoder.encode(&ack, &mut self.waiting);
    }

    /// Handles a mode request and returns its MAV_RESULT.
    fn asked_for_mode(&mut self, main: f32, sub: f32) -> u8 {
        let Some(mode) = Mode::of(self.personality, main, sub) else { return 2 };
        let refused = match mode {
            // PX4 accepts MANUAL only while sticks arrive, and OFFBOARD only while setpoints arrive.
            Mode::Manual => self.personality == Personality::Px4 && !self.manual_allowed,
            Mode::Guided => self.personality == Personality::Px4 && !self.setpoint_alive(),
            Mode::Hold | Mode::Return | Mode::Circle => false,
        };
        if refused {
            return 1;
        }
        self.set_mode(mode);
        0
    }

    fn manual_control(&mut self, m: &ManualControl) {
        // COM_RC_IN_MODE 0 and 4 ignore sticks over MAVLink.
        let listens = !matches!(self.parameters.get("COM_RC_IN_MODE") as i32, 0 | 4);
        if self.personality == Personality::Px4 && listens && m.target == SYSTEM {
            self.sticks.manual(self.now_us, m);
            self.counts.sticks += 1;
        } else {
            self.counts.ignored += 1;
        }
    }

    fn channels_override(&mut self, system: u8, m: &RcChannelsOverride) {
        let ours = f64::from(system) == self.parameters.get("MAV_GCS_SYSID");
        if self.personality == Personality::Ardupilot && ours && m.target_system == SYSTEM {
            self.sticks.override_channels(self.now_us, m);
            // Overrides count as heartbeats of the ground station.
            self.station_us = Some(self.now_us);
            self.counts.sticks += 1;
        } else {
            self.counts.ignored += 1;
        }
    }

    fn attitude_target(&mut self, m: &SetAttitudeTarget) {
        let attitude = law::roll_and_pitch(m.q).filter(|_| m.type_mask & 128 == 0);
        let guided = self.personality == Personality::Px4 || self.mode == Mode::Guided;
        let Some([roll, pitch]) = attitude.filter(|_| m.target_system == SYSTEM) else {
            self.counts.ignored += 1;
            return;
        };
        if !guided {
            self.counts.ignored += 1;
            return;
        }
        let thrust = f64::from(m.thrust);
        let thrust = (m.type_mask & 64 == 0 && thrust.is_finite()).then(|| thrust.clamp(0.0, 1.0));
        self.setpoint = Some(Setpoint { at_us: self.now_us, roll, pitch, thrust });
        self.counts.targets += 1;
    }

    fn sticks_alive(&self) -> bool {
        let timeout = match self.personality {
            Personality::Px4 => self.parameters.get("COM_RC_LOSS_T"),
            Personality::Ardupilot => self.parameters.get("RC_OVERRIDE_TIME"),
        };
        self.sticks.age_s(self.now_us).is_some_and(|age| age <= timeout)
    }

    fn setpoint_alive(&self) -> bool {
        let timeout = match self.personality {
            Personality::Px4 => self.parameters.get("COM_OF_LOSS_T"),
            Personality::Ardupilot => self.parameters.get("GUIDED_TIMEOUT"),
        };
        self.setpoint
            .is_some_and(|setpoint| (self.now_us - setpoint.at_us) as f64 * 1e-6 <= timeout)
    }

    /// Sends a STATUSTEXT; `words` has at most 25 bytes.
    fn send_text(&mut self, severity: u8, words: &[u8]) {
        let mut text = [0; 25];
        text[..words.len()].copy_from_slice(words);
        let line = StatusText { severity, text, ..StatusText::default() };
        self.encoder.encode(&line, &mut self.waiting);
    }

    /// Checks the stack's failsafes and changes the mode if one triggers.
    fn watch(&mut self) {
        if self.steps.is_multiple_of(LOOK_EVERY) {
            let steady = self.sticks.steady_s(self.now_us).is_some_and(|s| s >= STICKS_SEEN_S);
            self.manual_allowed = self.sticks_alive() && steady;
        }
        let failsafe: Option<(Mode, &[u8])> = match self.personality {
            Personality::Px4 => self.px4_failsafe(),
            Personality::Ardupilot => self.ardupilot_failsafe(),
        };
        if let Some((mode, words)) = failsafe {
            self.counts.failsafes += 1;
            self.send_text(2, words);
            self.set_mode(mode);
        }
    }

    /// Whether the mode has lasted longer than 0.5 s, the time allowed for its first setpoint.
    fn settled(&self) -> bool {
        (self.now_us - self.entered_us) as f64 * 1e-6 > 0.5
    }

    /// PX4's failsafe. In OFFBOARD, only lost setpoints trigger it; in every other mode, lost sticks do. Lost sticks do not
    /// interrupt a return flight.
    fn px4_failsafe(&mut self) -> Option<(Mode, &'static [u8])> {
        if self.mode == Mode::Guided {
            let lost = self.settled() && !self.setpoint_alive();
            return lost.then_some((Mode::Hold, b"Offboard control lost"));
        }
        if self.sticks.age_s(self.now_us).is_none() || self.sticks_alive() {
            return None;
        }
        self.sticks = Sticks::default();
        if self.mode == Mode::Return {
            return None;
        }
        let mode = match self.parameters.get("NAV_RCL_ACT") as i32 {
            1 => Mode::Hold,
            2 => Mode::Return,
            _ => return None,
        };
        Some((mode, b"Manual control lost"))
    }

    /// ArduPilot's failsafe. If the mode does not change, this function itself sends the text.
    fn ardupilot_failsafe(&mut self) -> Option<(Mode, &'static [u8])> {
        let act = self.failsafes.watch(&self.seen(), &self.parameters)?;
        if act.drops_overrides {
            self.sticks = Sticks::default();
        }
        if act.mode.is_none() {
            self.send_text(4, act.words);
        }
        act.mode.map(|mode| (mode, act.words))
    }

    /// Inputs of ArduPilot's failsafes.
    fn seen(&self) -> Seen {
        let age = |at: u64| (self.now_us - at) as f64 * 1e-6;
        Seen {
            steps: self.steps,
            now_us: self.now_us,
            mode: self.mode,
            radio: self.has_radio(),
            sticks_s: self.sticks.overridden_s(self.now_us),
            station_s: self.station_us.map(age),
        }
    }

    /// Whether ArduPilot treats the sticks as released: RC_FS_TIMEOUT has passed without an override, and no RC
    /// transmitter is bound.
    fn sticks_end(&self) -> bool {
        let patience = self.parameters.get("RC_FS_TIMEOUT");
        let ended = self.sticks.age_s(self.now_us).is_some_and(|age| age > patience);
        self.personality == Personality::Ardupilot && !self.has_radio() && ended
    }

    /// Whether an RC transmitter is bound. Its sticks are released and its throttle is closed.
    fn has_radio(&self) -> bool {
        self.parameters.get("SIM_RC_FAIL") == 0.0
    }

    /// Whether GUIDED no longer has a valid target; ArduPilot then turns back to the place where GUIDED was entered.
    pub fn turns_back(&self) -> bool {
        let ardupilot = self.personality == Personality::Ardupilot;
        ardupilot && self.mode == Mode::Guided && !self.setpoint_alive()
    }

    fn command(&mut self) -> Inputs {
        if self.mode == Mode::Manual {
            // between two samples the last command holds
            let samples = match self.personality {
                Personality::Px4 => true,
                Personality::Ardupilot => self.steps.is_multiple_of(SAMPLE_EVERY),
            };
            return match samples {
                true if self.has_radio() && !self.sticks_alive() => {
                    sticks::ardupilot(RADIO_US, &self.parameters)
                }
                true if self.sticks_end() => sticks::released(),
                true => self.sticks.inputs(self.personality, &self.parameters, self.commanded),
                false => self.commanded,
            };
        }
        let setpoint = self.setpoint.filter(|_| self.mode == Mode::Guided && self.setpoint_alive());
        match setpoint {
            Some(Setpoint { roll, pitch, thrust, .. }) => {
                self.law.attitude(&self.measured, roll, pitch, thrust)
            }
            None if self.turns_back() => self.law.attitude(&self.measured, TURN_BACK, 0.0, None),
            None => self.law.level(&self.measured),
        }
    }
}

impl fmt::Debug for FlightController {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} in {:?}", self.personality, self.mode)
    }
}
