//! The vehicle side of real flight controllers, in bytes: what is asked of them, when, and what is believed.

use std::path::Path;
use std::time::Duration;

use crate::link_support::{Shown, frame_from, peer};
use greylag::link::autopilot::Severity;
use greylag::link::signing::{Key, Signer};
use greylag::link::vehicle::real::parameters::Standing;
use greylag::link::vehicle::{
    Authority, Axis, Demand, Fault, Faults, Notice, Order, Outputs, Profile, Real, Sitl, Stack,
    Telemetry, Vehicle,
};
use greylag::physics::actuators::Actuators;
use greylag::physics::servos::Travels;
use greylag::physics::{Airframe, Command, Controls, Time};
use mavlink::MavlinkVersion::V2;
use mavlink::Message;
use mavlink::dialects::ardupilotmega::*;

const HEARTBEAT: u32 = 0;
const MANUAL_CONTROL: u32 = 69;
const CHANNELS_OVERRIDE: u32 = 70;
const COMMAND_LONG: u32 = 76;
const ATTITUDE_TARGET: u32 = 82;
const TIME_SYNC: u32 = 111;
const DO_SET_MODE: u16 = 176;
const SET_MESSAGE_INTERVAL: u16 = 511;
/// HOLD of PX4, LOITER of ArduPlane.
const PX4_HOLD: u32 = 4 << 16 | 3 << 24;
const ARDUPILOT_LOITER: u32 = 12;

/// A controller played by hand, with the vehicle side that hears it, in steps of 10 ms.
struct Played {
    real: Real,
    stack: Stack,
    /// Time since the start, ms.
    ms: u64,
    mode: u32,
    /// Each how many steps a state comes.
    every: u64,
    /// Each how many steps a state is left out.
    skipped: u64,
    /// The number of the controller's next frame, and by how much it grows, where its frames are numbered.
    sequence: Option<(u8, u8)>,
    /// The controller's heartbeats do not come.
    heartless: bool,
    /// The controller signs its frames.
    signer: Option<Signer>,
    /// The states that were delivered.
    states: Vec<Telemetry>,
    demand: Demand,
    /// The frames that came out, with the time, ms.
    out: Vec<(u64, u32, Vec<u8>)>,
    notices: Vec<Notice>,
}

/// What asks for nothing.
const NOTHING: Demand = Demand { outputs: Outputs::Disarmed, attitude: [0.0; 2], fault: None };
const RIGHT: Command = Command { aileron: 0.5, elevator: 0.0, throttle: 0.25, rudder: 0.0 };

fn armed(command: Command) -> Demand {
    Demand { outputs: Outputs::Armed(command), ..NOTHING }
}

impl Played {
    fn new(stack: Stack, authority: Authority) -> Self {
        let airframe = Airframe::load(Path::new("params/x8/airframe.toml")).unwrap();
        let profile = Profile { stack, authority, actuators: airframe.actuators };
        Played {
            real: Real::new(profile),
            stack,
            ms: 0,
            mode: if stack == Stack::Px4 { PX4_HOLD } else { ARDUPILOT_LOITER },
            every: 1,
            skipped: u64::MAX,
            sequence: None,
            heartless: false,
            signer: None,
            states: vec![],
            demand: NOTHING,
            out: vec![],
            notices: vec![],
        }
    }

    fn host(&self) -> Duration {
        Duration::from_millis(self.ms)
    }

    /// A frame of the controller.
    fn says(&mut self, message: &MavMessage) {
        self.says_from(1, 1, message);
    }

    /// A frame of anyone on its link.
    fn says_from(&mut self, system: u8, component: u8, message: &MavMessage) {
        let mut bytes = frame_from(V2, system, component, message);
        if let Some((number, by)) = &mut self.sequence {
            bytes = numbered(&bytes, *number);
            *number = number.wrapping_add(*by);
        }
        if let Some(signer) = &mut self.signer {
            bytes = signer.sign(1000 * self.ms, 0, &bytes);
        }
        let (host, demand) = (self.host(), self.demand);
        let mut states = vec![];
        self.real.handle(host, peer(1), &bytes, |state| states.push(state));
        for state in &states {
            let answer = self.real.answer(host, state.time, &demand);
            self.sent(&answer);
        }
        self.states.extend(states);
    }

    /// The three messages that make a state of the controller's clock, ms; what came of it.
    fn state(&mut self, boot_ms: u64) -> Telemetry {
        let mut shown = Shown::at(1000 * boot_ms);
        // A breath of turbulence, so that nothing stands still.
        shown.attitude.rollspeed = 1e-3 * (boot_ms % 70) as f32;
        self.says(&MavMessage::HIGHRES_IMU(shown.imu));
        self.says(&MavMessage::VFR_HUD(shown.air));
        self.says(&MavMessage::ATTITUDE_QUATERNION(shown.attitude));
        *self.states.last().unwrap()
    }

    /// A value of a parameter, as the controller tells it.
    fn parameter(&mut self, name: &str, value: f32) {
        self.says(&MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
            param_value: value,
            param_count: 2,
            param_id: name.into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
            ..Default::default()
        }));
    }

    fn sent(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let (frame, rest) = bytes.split_at(12 + bytes[1] as usize);
            let id = u32::from_le_bytes([frame[7], frame[8], frame[9], 0]);
            self.out.push((self.ms, id, frame[10..frame.len() - 2].to_vec()));
            bytes = rest;
        }
    }

    fn heartbeat(&mut self) {
        let autopilot = match self.stack {
            Stack::Px4 => MavAutopilot::MAV_AUTOPILOT_PX4,
            Stack::Ardupilot => MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        };
        self.says(&beat(autopilot, self.mode));
    }

    /// A step: a heartbeat each second, a state each `every` steps, what is due.
    fn step(&mut self) {
        if self.ms.is_multiple_of(1000) && !self.heartless {
            self.heartbeat();
        }
        let step = self.ms / 10;
        if step.is_multiple_of(self.every) && !(step + 1).is_multiple_of(self.skipped) {
            self.state(self.ms);
        }
        let due = self.real.due(self.host()).unwrap_or_default();
        self.sent(&due);
        self.notices.extend(std::iter::from_fn(|| self.real.take_notice()));
        self.ms += 10;
    }

    fn run(&mut self, ms: u64) {
        (0..ms / 10).for_each(|_| self.step());
    }

    /// Steers: asks, and shows the steered mode.
    fn engage(&mut self) {
        self.demand = armed(RIGHT);
        self.run(700);
        self.mode = self.stack.steered(self.real.profile().authority).custom(self.stack);
        self.heartbeat();
        assert!(self.real.flies(), "{:?}", self.notices);
    }

    /// Frames with a number, with their times.
    fn frames(&self, id: u32) -> Vec<(u64, Vec<u8>)> {
        self.out.iter().filter(|o| o.1 == id).map(|o| (o.0, o.2.clone())).collect()
    }

    /// Times, ms, with parameters 1 and 2 of each command with this number.
    fn commands(&self, number: u16) -> Vec<(u64, [f32; 2])> {
        let float =
            |p: &[u8], at: usize| f32::from_le_bytes([p[at], p[at + 1], p[at + 2], p[at + 3]]);
        let asked = self.frames(COMMAND_LONG).into_iter();
        asked
            .filter(|(_, p)| p.len() > 29 && u16::from_le_bytes([p[28], p[29]]) == number)
            .map(|(ms, p)| (ms, [float(&p, 0), float(&p, 4)]))
            .collect()
    }

    /// Times, ms, with the main mode of each request for a mode.
    fn requests(&self) -> Vec<(u64, f32)> {
        self.commands(DO_SET_MODE).into_iter().map(|(ms, [_, main])| (ms, main)).collect()
    }

    /// Whether something of this kind was said as an error.
    fn complained(&self, words: &str) -> bool {
        let hit = |notice: &Notice| matches!(notice, Notice::Text(Severity::Error, said) if said.contains(words));
        self.notices.iter().any(hit)
    }

    /// The reason of the hand-back, if there was one.
    fn released(&self) -> Option<String> {
        self.notices.iter().find_map(|notice| match notice {
            Notice::Released(reason) => Some(reason.clone()),
            _ => None,
        })
    }
}

/// A frame with another sequence number.
fn numbered(frame: &[u8], sequence: u8) -> Vec<u8> {
    let mut bytes = frame.to_vec();
    let end = bytes.len() - 2;
    bytes[4] = sequence;
    let id = u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]);
    let crc = mavlink::calculate_crc(&bytes[1..end], MavMessage::extra_crc(id));
    bytes[end..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

fn beat(autopilot: MavAutopilot, mode: u32) -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA {
        custom_mode: mode,
        mavtype: MavType::MAV_TYPE_FIXED_WING,
        autopilot,
        base_mode: MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED
            | MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
        ..Default::default()
    })
}

/// The answer to the last request for a mode, or for a stream.
fn ack(command: MavCmd, result: MavResult, component: u8) -> MavMessage {
    MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
        command,
        result,
        target_system: 1,
        target_component: component,
        ..Default::default()
    })
}

#[test]
fn our_heartbeat_beats_once_a_second_before_a_controller_is_heard_too() {
    let airframe = Airframe::load(Path::new("params/x8/airframe.toml")).unwrap();
    let profile = Profile {
        stack: Stack::Px4,
        authority: Authority::Surfaces,
        actuators: airframe.actuators,
    };
    let mut real = Real::new(profile);
    assert_eq!((real.controller(), real.system(), real.peer()), (None, None, None));
    let beats = (0..500).filter(|i| real.due(Duration::from_millis(10 * i)).is_some()).count();
    assert_eq!(beats, 5);
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.run(3000);
    assert_eq!(played.frames(HEARTBEAT).len(), 3);
    assert_eq!((played.real.controller(), played.real.system()), (Some((12, true)), Some(1)));
}

#[test]
fn px4_sees_half_a_second_of_sticks_before_it_is_asked_for_the_mode() {
    for (stack, lead_ms, sticks) in
        [(Stack::Px4, 500, MANUAL_CONTROL), (Stack::Ardupilot, 0, CHANNELS_OVERRIDE)]
    {
        let mut played = Played::new(stack, Authority::Surfaces);
        played.run(2000);
        assert!(played.requests().is_empty() && played.frames(sticks).is_empty());
        played.demand = armed(RIGHT);
        played.run(900);
        let steered = if stack == Stack::Px4 { 1.0 } else { 0.0 };
        // It is asked again every 250 ms.
        let wanted: Vec<_> = (0..4).map(|i| (2000 + lead_ms + 250 * i, steered)).collect();
        let asked = played.requests();
        assert_eq!(asked[..], wanted[..asked.len()], "{stack}");
        assert!(asked.len() >= 2, "{asked:?}");
        let first = played.frames(sticks)[0].0;
        assert!(first <= 2010, "{stack}: first sticks at {first} ms");
    }
}

#[test]
fn a_mode_that_is_not_shown_within_its_time_is_given_up_with_the_reason() {
    for (result, component, words) in [
        // An answer to another companion is none to us.
        (MavResult::MAV_RESULT_DENIED, 190, "it did not answer"),
        (MavResult::MAV_RESULT_DENIED, 191, "a failsafe or a geofence"),
        (MavResult::MAV_RESULT_ACCEPTED, 191, "it accepted, but showed another mode"),
    ] {
        let mut played = Played::new(Stack::Px4, Authority::Surfaces);
        played.run(2000);
        played.demand = armed(RIGHT);
        played.run(600);
        played.says(&ack(MavCmd::MAV_CMD_DO_SET_MODE, result, component));
        played.run(2890);
        assert_eq!(played.released(), None);
        played.run(50);
        let reason = played.released().unwrap();
        assert!(reason.contains(words), "{reason}");
        // It is asked for HOLD, and nothing is begun again while the demand lasts.
        played.run(1000);
        assert_eq!(played.requests().last().unwrap().1, 4.0);
        assert!(!played.real.is_engaged());
    }
}

#[test]
fn a_command_that_is_not_finite_is_sent_as_the_last_that_was() {
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.run(2000);
    played.engage();
    played.run(100);
    let before = played.frames(MANUAL_CONTROL).last().unwrap().1.clone();
    played.demand = armed(Command { aileron: f64::NAN, ..RIGHT });
    played.run(50);
    let after = played.frames(MANUAL_CONTROL);
    assert!(after[after.len() - 5..].iter().all(|(_, payload)| *payload == before));
    // y, + right, in thousandths.
    assert_eq!(i16::from_le_bytes([before[2], before[3]]), 500);
    assert_eq!(played.real.counts().bad_commands, 5);
}

#[test]
fn a_fault_hands_the_aircraft_back_and_the_channels_to_the_radio() {
    let mut played = Played::new(Stack::Ardupilot, Authority::Surfaces);
    played.run(2000);
    played.engage();
    played.run(500);
    let at = played.ms;
    played.demand.fault = Some(Fault::Lost);
    played.run(1000);
    assert!(played.released().is_some());
    // LOITER, asked at once and every 250 ms, each time with channels that are released.
    let loiter: Vec<_> = played.requests().into_iter().filter(|r| r.0 >= at).collect();
    let wanted: Vec<_> = (0..4).map(|i| (at + 250 * i, 12.0)).collect();
    assert_eq!(loiter, wanted);
    let channels = played.frames(CHANNELS_OVERRIDE).into_iter().filter(|f| f.0 >= at);
    let released: Vec<_> = channels.map(|(_, p)| p[..6].to_vec()).collect();
    assert_eq!(released, vec![vec![0; 6]; 4]);
}

#[test]
fn a_radio_is_believed_only_while_nothing_is_overridden() {
    let receiver = |alive: bool| {
        let bits = if alive {
            MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_RC_RECEIVER
        } else {
            MavSysStatusSensor::empty()
        };
        MavMessage::SYS_STATUS(SYS_STATUS_DATA {
            onboard_control_sensors_present: bits,
            onboard_control_sensors_enabled: bits,
            onboard_control_sensors_health: bits,
            ..Default::default()
        })
    };
    let mut played = Played::new(Stack::Ardupilot, Authority::Surfaces);
    played.run(2000);
    assert_eq!(played.real.radio_warning(), None);
    played.says(&receiver(true));
    // How long it flies so is not known yet.
    let warning = played.real.radio_warning().unwrap();
    assert!(warning.contains("in MANUAL for FS_LONG_TIMEOUT, then returns"), "{warning}");
    played.parameter("FS_LONG_TIMEOUT", 2.0);
    let warning = played.real.radio_warning().unwrap();
    assert!(warning.contains("in MANUAL for 2 s, then returns"), "{warning}");
    played.says(&receiver(false));
    played.engage();
    // Our own overrides look like one.
    played.says(&receiver(true));
    assert_eq!(played.real.radio_warning(), None);
    // By attitudes, or at PX4, a dead companion leaves nobody's sticks in force.
    for (stack, authority) in
        [(Stack::Ardupilot, Authority::Attitude), (Stack::Px4, Authority::Surfaces)]
    {
        let mut played = Played::new(stack, authority);
        played.run(2000);
        played.says(&receiver(true));
        assert_eq!(played.real.radio_warning(), None);
    }
}

#[test]
fn a_thin_stream_is_an_obstacle_with_its_rate() {
    // Four states of five are enough, and two of four are not.
    for (every, skipped, thin) in [(1, u64::MAX, false), (1, 5, false), (2, u64::MAX, true)] {
        let mut played = Played::new(Stack::Px4, Authority::Attitude);
        (played.every, played.skipped) = (every, skipped);
        played.run(500);
        for (name, value) in [("COM_OF_LOSS_T", 0.5), ("COM_OBL_RC_ACT", 5.0)] {
            played.parameter(name, value);
        }
        played.run(3000);
        assert_eq!(played.real.denial(31), None, "nothing was denied");
        let said = played.real.obstacle();
        let words = "ATTITUDE_QUATERNION comes at 50 Hz, 100 are needed";
        assert_eq!(said.as_ref().is_some_and(|said| said.contains(words)), thin, "{said:?}");
        assert!(thin || said.is_none(), "{said:?}");
    }
}

#[test]
fn what_others_send_is_counted_and_not_believed() {
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.run(1000);
    let states = played.real.counts().states;
    assert_eq!((states, played.real.counts().foreign), (100, 0));
    let stranger = frame_from(V2, 2, 1, &MavMessage::VFR_HUD(VFR_HUD_DATA::default()));
    played.real.handle(played.host(), peer(1), &stranger, |_| panic!("a state of another"));
    let counts = played.real.counts();
    assert_eq!((counts.states, counts.foreign), (states, 1));
}

#[test]
fn without_a_state_for_longer_than_0_3_s_the_aircraft_is_handed_back() {
    for (stack, authority) in
        [(Stack::Ardupilot, Authority::Attitude), (Stack::Px4, Authority::Surfaces)]
    {
        let mut played = Played::new(stack, authority);
        played.run(2000);
        played.demand = armed(RIGHT);
        played.run(700);
        played.mode = stack.steered(authority).custom(stack);
        played.heartbeat();
        played.run(100);
        // The last state came 10 ms ago.
        played.every = u64::MAX;
        played.run(300);
        assert_eq!(played.released(), None);
        played.run(10);
        let reason = played.released().unwrap();
        assert!(reason.contains("no state of the vehicle for 0.3 s"), "{reason}");
    }
}

#[test]
fn ardupilot_is_sent_its_channels_at_50_hz_and_px4_its_sticks_at_100() {
    for (stack, id, hz) in
        [(Stack::Ardupilot, CHANNELS_OVERRIDE, 50), (Stack::Px4, MANUAL_CONTROL, 100)]
    {
        let mut played = Played::new(stack, Authority::Surfaces);
        played.run(2000);
        played.engage();
        let before = played.frames(id).len();
        played.run(1000);
        assert_eq!(played.frames(id).len() - before, hz, "{stack}");
    }
}

#[test]
fn streams_are_asked_for_at_the_first_frame_and_then_once_a_second() {
    let mut played = Played::new(Stack::Px4, Authority::Attitude);
    played.heartbeat();
    let due = played.real.due(played.host()).unwrap();
    played.sent(&due);
    let wanted = [(31.0, 1e4), (105.0, 1e4), (74.0, 2e4), (33.0, 1e5), (231.0, 5e5)];
    let asked: Vec<_> = played.commands(SET_MESSAGE_INTERVAL).into_iter().map(|c| c.1).collect();
    assert_eq!(asked, wanted.map(|(id, us)| [id, us]));
    // Those that come at their rate are not asked for again.
    played.run(3500);
    let again = played.commands(SET_MESSAGE_INTERVAL);
    assert!(again[5..].iter().all(|(ms, _)| *ms >= 1000), "{again:?}");
    assert!(again.iter().filter(|(ms, [id, _])| *ms > 0 && *id == 31.0).count() <= 1, "{again:?}");
    assert_eq!(again.iter().filter(|(ms, [id, _])| *ms > 0 && *id == 33.0).count(), 3, "{again:?}");
}

#[test]
fn a_controller_that_sends_nothing_but_heartbeats_is_asked_once_a_second_too() {
    let mut played = Played::new(Stack::Px4, Authority::Attitude);
    played.every = u64::MAX;
    played.heartbeat();
    played.ms = 10;
    played.run(2490);
    let asked = played.commands(SET_MESSAGE_INTERVAL).into_iter();
    let times: Vec<u64> = asked.filter(|(_, [id, _])| *id == 31.0).map(|(ms, _)| ms).collect();
    assert_eq!(times, [10, 1010, 2010]);
}

#[test]
fn a_stream_that_is_denied_is_an_obstacle_with_the_remedy() {
    let mut played = Played::new(Stack::Ardupilot, Authority::Attitude);
    played.heartbeat();
    let due = played.real.due(played.host()).unwrap();
    played.sent(&due);
    // Answers come in the order of the requests: ATTITUDE_QUATERNION was the first.
    let interval = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL;
    played.says(&ack(interval, MavResult::MAV_RESULT_DENIED, 190));
    assert_eq!(played.real.denial(31), None, "an answer to another");
    played.says(&ack(interval, MavResult::MAV_RESULT_DENIED, 191));
    let words = played.real.denial(31).unwrap();
    assert!(words.contains("denies ATTITUDE_QUATERNION at 100 Hz"), "{words}");
    assert_eq!(played.real.denial(105), None);
}

#[test]
fn only_an_autopilot_of_the_profiles_stack_is_flown() {
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    // A gimbal that says PX4, and an autopilot's place with no autopilot in it.
    played.says_from(1, 154, &beat(MavAutopilot::MAV_AUTOPILOT_PX4, PX4_HOLD));
    played.says_from(1, 1, &beat(MavAutopilot::MAV_AUTOPILOT_INVALID, PX4_HOLD));
    assert_eq!(played.real.controller(), None);
    played.says_from(7, 1, &beat(MavAutopilot::MAV_AUTOPILOT_PX4, PX4_HOLD));
    assert_eq!((played.real.system(), played.real.controller()), (Some(7), Some((12, true))));
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.run(100);
    assert!(!played.complained("fly it with --profile"));
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.stack = Stack::Ardupilot;
    played.run(100);
    assert!(played.complained("ArduPilot: fly it with --profile ardupilot"));
    assert!(played.real.obstacle().unwrap().contains("--profile ardupilot"));
}

#[test]
fn surfaces_are_known_to_move_only_while_a_controller_flies_them_as_commanded() {
    let sitl = Vehicle::Sitl(Sitl::new(1, Travels::alike(0.5)));
    assert!(sitl.moves_surfaces() && sitl.flies_surfaces() && !sitl.has_channels());
    for (authority, surfaces) in [(Authority::Surfaces, true), (Authority::Attitude, false)] {
        let mut played = Played::new(Stack::Ardupilot, authority);
        let vehicle = |played: &Played| Vehicle::Real(Box::new(played.real.clone()));
        played.run(2000);
        let before = vehicle(&played);
        assert!(!before.moves_surfaces());
        assert_eq!((before.flies_surfaces(), before.has_channels()), (surfaces, surfaces));
        played.demand = armed(RIGHT);
        played.run(100);
        played.mode = Stack::Ardupilot.steered(authority).custom(Stack::Ardupilot);
        played.heartbeat();
        assert_eq!(vehicle(&played).moves_surfaces(), surfaces);
        assert_eq!(vehicle(&played).counts(), played.real.counts());
        assert_eq!((vehicle(&played).peer(), sitl.peer()), (Some(peer(1)), None));
    }
}

#[test]
fn states_that_come_late_twice_after_a_gap_or_a_restart_are_told_apart_with_their_times() {
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.heartbeat();
    let next = |lost| Order::Next { lost };
    // Of 10 ms each, with jitter: 17 ms are two, of which one is missing, 14 ms are one.
    for (boot_ms, order) in [
        (50_000, Order::First),
        (50_010, next(0)),
        (50_027, next(1)),
        (50_041, next(0)),
        (50_041, Order::Repeated),
        (50_031, Order::Late),
        // By a second it comes late, by more the clock has started anew.
        (49_041, Order::Late),
        (49_040, Order::First),
        (49_050, next(0)),
    ] {
        let state = played.state(boot_ms);
        assert_eq!((state.order, state.time), (order, Time::from_micros(1000 * boot_ms)));
    }
    let counts = played.real.counts();
    assert_eq!(
        (counts.states, counts.starts, counts.late, counts.repeated, counts.lost),
        (6, 2, 2, 1, 1)
    );
    assert_eq!((counts.faulty, counts.incomplete), (0, 0));
}

#[test]
fn a_velocity_over_ground_that_no_aircraft_has_is_left_out() {
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    let position = |vx: i16| {
        let (lat, lon) = (450_000_000, 75_000_000);
        MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
            lat,
            lon,
            vx,
            ..Default::default()
        })
    };
    played.run(1000);
    played.says(&position(2000));
    assert_eq!(played.state(1000).velocity, [20.0, 0.0, 0.0]);
    // The smallest and the largest number of the field.
    for vx in [i16::MIN, i16::MAX] {
        played.says(&position(vx));
        let boot_ms = played.ms + 10;
        played.ms += 10;
        assert_eq!(played.state(boot_ms).velocity, [20.0, 0.0, 0.0], "{vx}");
    }
}

#[test]
fn a_controllers_force_that_was_never_believed_is_that_of_level_flight() {
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.heartbeat();
    let mut shown = Shown::at(1_000_000);
    shown.imu.zacc = 1e30;
    played.says(&MavMessage::HIGHRES_IMU(shown.imu));
    played.says(&MavMessage::VFR_HUD(shown.air));
    played.says(&MavMessage::ATTITUDE_QUATERNION(shown.attitude));
    let state = played.states[0];
    assert!(state.faults.contains(Faults::SPECIFIC_FORCE), "{}", state.faults);
    assert_eq!(state.specific_force, [0.0, 0.0, -9.81]);
}

#[test]
fn the_actuators_move_on_by_a_step_for_each_period_that_has_passed() {
    // A controller does not report its surfaces: they are the airframe's, moved by what was commanded.
    for (passed_ms, steps) in [(10, 1), (14, 1), (17, 2), (30, 3), (150, 15), (5000, 20)] {
        let mut played = Played::new(Stack::Px4, Authority::Surfaces);
        played.heartbeat();
        played.demand = armed(RIGHT);
        played.state(1000);
        let seen = played.state(1000 + passed_ms).actuators;
        let figures = played.real.profile().actuators;
        let mut actuators = Actuators::at_rest(&Controls::default());
        (0..steps).for_each(|_| actuators.step(&RIGHT, &figures));
        assert_eq!(seen, actuators.observed(&figures), "{passed_ms} ms");
    }
}

#[test]
fn an_attitude_is_commanded_with_the_time_of_its_state() {
    for stack in [Stack::Px4, Stack::Ardupilot] {
        let mut played = Played::new(stack, Authority::Attitude);
        played.run(2000);
        played.engage();
        played.run(500);
        let sent = played.frames(ATTITUDE_TARGET);
        assert!(sent.len() > 20, "{stack}: {}", sent.len());
        for (ms, payload) in sent {
            let boot_ms = u32::from_le_bytes([payload[0], payload[1], payload[2], payload[3]]);
            assert_eq!(u64::from(boot_ms), ms, "{stack}");
        }
    }
}

#[test]
fn the_way_there_and_back_is_measured_five_times_a_second() {
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.run(3000);
    assert_eq!(played.frames(TIME_SYNC).len(), 15);
    assert!(played.real.survey().round_trips().is_empty());
    let answer = |played: &mut Played, took_ms: u64| {
        let ts1 = 1_000_000 * (played.ms - took_ms) as i64;
        played.says(&MavMessage::TIMESYNC(TIMESYNC_DATA { tc1: 1, ts1, ..Default::default() }));
    };
    let ms = Duration::from_millis;
    for took_ms in [30, 10, 20] {
        answer(&mut played, took_ms);
    }
    assert_eq!(played.real.survey().round_trips(), [10, 20, 30].map(ms));
    // The newest 256 are kept.
    (0..300).for_each(|_| answer(&mut played, 5));
    assert_eq!(played.real.survey().round_trips(), vec![ms(5); 256]);
}

#[test]
fn a_time_that_was_not_ours_is_no_round_trip() {
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.run(5000);
    // The last two are 1 ms ahead of our clock, and 3.001 s behind it.
    for ts1 in [0, -1, i64::MIN, i64::MAX, 5_001_000_000, 1_999_000_000] {
        played.says(&MavMessage::TIMESYNC(TIMESYNC_DATA { tc1: 1, ts1, ..Default::default() }));
        assert!(played.real.survey().round_trips().is_empty(), "{ts1} ns");
    }
}

#[test]
fn channels_are_released_only_when_ardupilot_gets_them_back() {
    for (stack, authority) in
        [(Stack::Px4, Authority::Surfaces), (Stack::Ardupilot, Authority::Attitude)]
    {
        let mut played = Played::new(stack, authority);
        played.run(2000);
        played.engage();
        played.demand.fault = Some(Fault::Lost);
        played.run(1000);
        assert!(played.requests().last().unwrap().0 > 2700, "{stack} was asked to hold");
        assert_eq!(played.frames(CHANNELS_OVERRIDE), [], "{stack}");
    }
    let mut played = Played::new(Stack::Ardupilot, Authority::Surfaces);
    played.run(2000);
    played.engage();
    played.run(500);
    let sent = played.frames(CHANNELS_OVERRIDE);
    assert!(!sent.is_empty() && sent.iter().all(|(_, p)| p[..6] != [0; 6]), "while we steer");
}

#[test]
fn who_steers_by_surfaces_needs_many_states_and_few_lost_frames() {
    for (authority, leaves) in [(Authority::Surfaces, true), (Authority::Attitude, false)] {
        let mut played = Played::new(Stack::Px4, authority);
        played.run(2000);
        played.engage();
        played.run(1000);
        assert_eq!(played.released(), None);
        // 33 of 100 Hz.
        played.every = 3;
        played.run(1200);
        let thin = played.released().is_some_and(|why| why.contains("states of the vehicle"));
        assert_eq!(thin, leaves, "{authority:?} {:?}", played.notices);

        let mut played = Played::new(Stack::Px4, authority);
        played.sequence = Some((0, 1));
        played.run(2000);
        played.engage();
        played.run(1000);
        assert_eq!(played.released(), None);
        // Each second frame is lost, by their numbers.
        played.sequence = Some((0, 2));
        played.run(1700);
        let lossy = played.released().is_some_and(|why| why.contains("loses 50 % of the frames"));
        assert_eq!(lossy, leaves, "{authority:?} {:?}", played.notices);
    }
}

#[test]
fn a_companion_with_our_ids_and_a_second_autopilot_are_intruders_and_others_are_not() {
    let none = beat(MavAutopilot::MAV_AUTOPILOT_INVALID, 0);
    let complaints = |played: &mut Played, words: &str| {
        played.step();
        let of =
            |n: &&Notice| matches!(n, Notice::Text(Severity::Error, said) if said.contains(words));
        played.notices.iter().filter(of).count()
    };
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.run(1000);
    // A camera of the aircraft, and another aircraft's companion.
    played.says_from(1, 100, &none);
    played.says_from(2, 191, &none);
    assert_eq!(complaints(&mut played, "on the vehicle's link"), 0);
    assert!(!played.real.obstacle().unwrap().contains("on the vehicle's link"));
    (0..3).for_each(|_| played.says_from(1, 191, &none));
    assert_eq!(complaints(&mut played, "another onboard computer with our ids"), 1);
    assert!(played.real.obstacle().unwrap().contains("system 1, component 191"));

    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.run(1000);
    let second = beat(MavAutopilot::MAV_AUTOPILOT_PX4, PX4_HOLD);
    (0..3).for_each(|_| played.says_from(2, 1, &second));
    assert_eq!(complaints(&mut played, "a second autopilot (system 2, component 1)"), 1);
    (0..3).for_each(|_| played.says_from(3, 1, &second));
    assert_eq!(complaints(&mut played, "a second autopilot (system 3, component 1)"), 1);
    // Both go on beating in turn.
    for _ in 0..3 {
        played.says_from(2, 1, &second);
        played.says_from(3, 1, &second);
    }
    assert_eq!(complaints(&mut played, "a second autopilot"), 2);
    assert_eq!(played.real.system(), Some(1));
}

#[test]
fn only_a_controller_that_signs_and_answers_nothing_shuts_us_out() {
    for (signs, answers, out) in
        [(true, false, true), (true, true, false), (false, false, false), (false, true, false)]
    {
        let mut played = Played::new(Stack::Px4, Authority::Attitude);
        played.signer = signs.then(|| Signer::new(Key::from_bytes([1; 32]), 0));
        played.heartbeat();
        assert!(!played.real.is_shut_out(), "nothing was asked yet");
        played.run(1000);
        if answers {
            played.parameter("COM_OF_LOSS_T", 0.5);
        }
        played.run(1000);
        assert_eq!(played.real.is_shut_out(), out, "signs {signs}, answers {answers}");
    }
}

#[test]
fn a_stream_that_the_flight_can_do_without_may_be_denied() {
    let mut played = Played::new(Stack::Ardupilot, Authority::Attitude);
    played.heartbeat();
    let due = played.real.due(played.host()).unwrap();
    played.sent(&due);
    let interval = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL;
    // Attitude, forces and air come; AOA_SSA does not.
    for result in [MavResult::MAV_RESULT_ACCEPTED; 3] {
        played.says(&ack(interval, result, 191));
    }
    played.says(&ack(interval, MavResult::MAV_RESULT_UNSUPPORTED, 191));
    assert_eq!(played.real.denial(11020), None);
    played.run(2000);
    assert!(!played.complained("denies"), "{:?}", played.notices);
}

#[test]
fn each_fault_is_said_with_the_remedy_of_its_stack() {
    for (fault, stack, part) in [
        (Fault::Reversed(Axis::Roll), Stack::Ardupilot, "RC1_REVERSED"),
        (Fault::Reversed(Axis::Pitch), Stack::Ardupilot, "RC2_REVERSED"),
        (Fault::Reversed(Axis::Roll), Stack::Px4, "CA_SV_CSn_TRQ_R"),
        (Fault::Reversed(Axis::Pitch), Stack::Px4, "CA_SV_CSn_TRQ_P"),
        (Fault::Reversed(Axis::Roll), Stack::Px4, "rolls left when the aileron is commanded right"),
        (
            Fault::Reversed(Axis::Pitch),
            Stack::Px4,
            "pitches up when the elevator is commanded down",
        ),
        (Fault::Unanswered(Axis::Roll), Stack::Px4, "no response to the aileron"),
        (Fault::Unanswered(Axis::Pitch), Stack::Px4, "no response to the elevator"),
        (Fault::Oscillation(Axis::Roll), Stack::Px4, "oscillates in roll, the aileron"),
        (Fault::Oscillation(Axis::Pitch), Stack::Px4, "oscillates in pitch, the elevator"),
        (Fault::Oscillation(Axis::Pitch), Stack::Ardupilot, "raise SCHED_LOOP_RATE"),
    ] {
        let words = fault.words(stack);
        assert!(words.contains(part), "{words}");
    }
    // PX4's loop has no rate to raise.
    assert!(!Fault::Oscillation(Axis::Roll).words(Stack::Px4).contains("raise"));
}

#[test]
fn a_mode_has_the_number_of_its_heartbeat() {
    assert_eq!(Stack::Px4.hold().custom(Stack::Px4), PX4_HOLD);
    assert_eq!(Stack::Ardupilot.hold().custom(Stack::Ardupilot), ARDUPILOT_LOITER);
    // Main mode 6 of PX4 is OFFBOARD, 1 is MANUAL; mode 15 of ArduPlane is GUIDED.
    let px4 = |authority| Stack::Px4.steered(authority).custom(Stack::Px4);
    assert_eq!([Authority::Attitude, Authority::Surfaces].map(px4), [6 << 16, 1 << 16]);
    let guided = Stack::Ardupilot.steered(Authority::Attitude);
    assert_eq!(guided.custom(Stack::Ardupilot), 15);
}

#[test]
fn a_controller_without_a_heartbeat_for_more_than_three_seconds_is_gone() {
    let mut played = Played::new(Stack::Px4, Authority::Surfaces);
    played.run(2000);
    played.engage();
    assert!(played.real.is_engaged());
    played.run(300);
    // The last heartbeat came at 2.7 s, when it was engaged, or at 3 s.
    assert_eq!(played.ms, 3000);
    played.step();
    played.heartless = true;
    // At 6 s it is three seconds old.
    played.run(3000);
    assert_eq!(played.released(), None);
    played.step();
    assert!(played.released().unwrap().contains("no heartbeat of the controller for 3 s"));
}

#[test]
fn a_parameter_is_unknown_or_absent_only_when_each_of_its_names_was_asked_for_in_vain() {
    let mut played = Played::new(Stack::Ardupilot, Authority::Surfaces);
    let standing = |played: &Played, name: &str| {
        let report = played.real.parameter_report();
        let found = report.into_iter().find(|(known, ..)| *known == name);
        found.map(|(_, standing, _)| standing)
    };
    played.run(1000);
    for name in ["MAV_GCS_SYSID", "RC_FS_TIMEOUT", "RC1_MIN"] {
        assert_eq!(standing(&played, name), Some(Standing::Unread), "{name} after a second");
    }
    // Five requests, 0.4 s apart; ten where it has two names.
    played.run(1500);
    assert_eq!(standing(&played, "RC1_MIN"), Some(Standing::Unknown));
    assert_eq!(standing(&played, "RC_FS_TIMEOUT"), Some(Standing::Absent));
    assert_eq!(standing(&played, "MAV_GCS_SYSID"), Some(Standing::Unread));
    played.run(2500);
    assert_eq!(standing(&played, "MAV_GCS_SYSID"), Some(Standing::Unknown));
}

#[test]
fn a_controller_that_is_found_is_named() {
    for (stack, words) in [
        (Stack::Px4, "controller found: PX4, system 1"),
        (Stack::Ardupilot, "controller found: ArduPilot, system 1"),
    ] {
        let mut played = Played::new(stack, Authority::Surfaces);
        played.run(100);
        let said = Notice::Text(Severity::Info, words.into());
        assert!(played.notices.contains(&said), "{:?}", played.notices);
    }
}

#[test]
fn the_survey_counts_bytes_and_keeps_a_rate_that_is_granted() {
    let mut played = Played::new(Stack::Px4, Authority::Attitude);
    played.every = 2;
    played.run(3010);
    let traffic = *played.real.survey().messages().find(|(id, _)| *id == HEARTBEAT).unwrap().1;
    let frame = frame_from(V2, 1, 1, &beat(MavAutopilot::MAV_AUTOPILOT_PX4, PX4_HOLD));
    assert_eq!((traffic.frames, traffic.bytes), (4, 4 * frame.len() as u64));
    assert_eq!(played.real.survey().hz(31), 50.0);
    // It was asked for once more at 3 s, first of all; its count begins anew, its rate stands.
    played.says(&ack(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, MavResult::MAV_RESULT_ACCEPTED, 191));
    let traffic = *played.real.survey().messages().find(|(id, _)| *id == 31).unwrap().1;
    assert_eq!((traffic.frames, traffic.hz), (0, 50.0));
}

#[test]
fn what_the_gyros_filter_and_the_loop_leave_of_the_delay_is_judged_by_surfaces() {
    use std::time::Duration;
    // `lqi` on the X8 swings by itself from 46 ms on. √2/2π of a period of the filter, a period of the loop, 20 ms between two looks
    // at the channels: 11 + 5 + 20, 22.5 + 5 + 20, 2.8 + 4 + 20.
    for (filter, rate, refused, warned) in [
        (20.0, 200.0, false, true),
        (10.0, 200.0, true, true),
        (80.0, 250.0, false, false),
        (4.0, 200.0, true, true),
    ] {
        let mut played = Played::new(Stack::Ardupilot, Authority::Surfaces);
        played.real.bear(Some(Duration::from_millis(46)));
        played.run(2000);
        played.parameter("INS_GYRO_FILTER", filter);
        played.parameter("SCHED_LOOP_RATE", rate);
        let words = played.real.delay_words().unwrap();
        assert!(words.contains(&format!("INS_GYRO_FILTER {filter}")), "{words}");
        assert!(words.contains("of the 46 ms at which the loop oscillates"), "{words}");
        let obstacle = played.real.delay_obstacle();
        assert_eq!(obstacle.is_some(), refused, "{filter} Hz, {rate} Hz: {obstacle:?}");
        if refused {
            assert!(obstacle.unwrap().contains("set INS_GYRO_FILTER 80"));
            continue;
        }
        played.engage();
        let said = played.notices.iter().any(|notice| {
            matches!(notice, Notice::Text(_, words) if words.starts_with("small delay margin"))
        });
        assert_eq!(said, warned, "{filter} Hz, {rate} Hz: {:?}", played.notices);
    }
    // By attitude the controller's own loops fly.
    let mut played = Played::new(Stack::Ardupilot, Authority::Attitude);
    played.real.bear(Some(Duration::from_millis(1)));
    played.run(2000);
    assert_eq!((played.real.delay_words(), played.real.delay_obstacle()), (None, None));
}

#[test]
fn a_stall_of_this_computer_is_no_silence_of_the_controller() {
    for (ms, kept) in [(400, true), (600, false)] {
        let mut played = Played::new(Stack::Px4, Authority::Surfaces);
        played.engage();
        played.run(1000);
        // Nothing is heard or done for so long; then everybody goes on.
        let missed = std::time::Duration::from_millis(ms);
        played.ms += ms;
        played.real.excuse(missed);
        let host = played.host();
        played.real.due(host);
        played.notices.extend(std::iter::from_fn(|| played.real.take_notice()));
        let released: Vec<_> = played
            .notices
            .iter()
            .filter_map(|notice| match notice {
                Notice::Released(words) => Some(words.clone()),
                _ => None,
            })
            .collect();
        match kept {
            true => assert_eq!(released, [""; 0], "{ms} ms"),
            false => assert_eq!(released, ["this computer stalled for 0.6 s"], "{ms} ms"),
        }
    }
}
