//! What each flight stack accepts: modes, streams, parameters.

use std::fmt;
use std::time::Duration;

use greylag_physics::airframe::ActuatorFigures;

/// A flight stack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stack {
    /// PX4, fixed wing.
    Px4,
    /// ArduPilot Plane.
    Ardupilot,
}

/// What the companion commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Authority {
    /// Surfaces and throttle, as sticks in MANUAL.
    Surfaces,
    /// Attitude and thrust, in OFFBOARD or GUIDED: the controller's own loops move the surfaces.
    Attitude,
}

/// How a real flight controller is flown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Its stack.
    pub stack: Stack,
    /// What it is commanded.
    pub authority: Authority,
    /// The aircraft's actuators, which the controller does not report the state of.
    pub actuators: ActuatorFigures,
}

/// A mode in the stack's own numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StackMode {
    /// The name that its ground stations show.
    pub name: &'static str,
    /// Main mode of PX4, the mode of ArduPilot.
    pub main: u8,
    /// Sub mode of PX4.
    pub sub: u8,
}

const fn mode(name: &'static str, main: u8, sub: u8) -> StackMode {
    StackMode { name, main, sub }
}

/// A stream to be asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stream {
    /// The message's number.
    pub id: u32,
    /// Its name, for the user.
    pub name: &'static str,
    /// Its rate, Hz.
    pub hz: f64,
    /// Whether the flight cannot do without.
    pub needed: bool,
    /// Bytes of its frame, MAVLink 2 with nothing cut off.
    pub bytes: u32,
}

const fn stream(id: u32, name: &'static str, hz: f64, needed: bool, payload: u32) -> Stream {
    Stream { id, name, hz, needed, bytes: payload + 12 }
}

const PX4_STREAMS: [Stream; 5] = [
    stream(31, "ATTITUDE_QUATERNION", 100.0, true, 48),
    stream(105, "HIGHRES_IMU", 100.0, true, 63),
    stream(74, "VFR_HUD", 50.0, true, 20),
    stream(33, "GLOBAL_POSITION_INT", 10.0, false, 28),
    stream(231, "WIND_COV", 2.0, false, 40),
];

const ARDUPILOT_STREAMS: [Stream; 7] = [
    stream(31, "ATTITUDE_QUATERNION", 100.0, true, 48),
    stream(105, "HIGHRES_IMU", 100.0, true, 63),
    stream(74, "VFR_HUD", 50.0, true, 20),
    stream(11020, "AOA_SSA", 50.0, false, 16),
    stream(33, "GLOBAL_POSITION_INT", 10.0, false, 28),
    stream(168, "WIND", 2.0, false, 12),
    // Whether a radio is bound.
    stream(1, "SYS_STATUS", 1.0, false, 43),
];

/// What a parameter must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Need {
    /// One of these.
    OneOf(&'static [f64]),
    /// Within these, both included.
    Between(f64, f64),
    /// The companion's own system id.
    OurSystem,
    /// Any number that makes sense for a channel's pulse width, µs: it is used.
    Pulse,
    /// A bit mask without any of these bits.
    Without(u32),
}

/// Whether firmware may lack a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Firmware without it is not one that the profile fits.
    Required,
    /// Some releases do not have it.
    Optional,
}

/// A parameter that is read and checked before engaging.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// Its names, newest release first: one of them is enough.
    pub names: &'static [&'static str],
    /// What it must be.
    pub need: Need,
    /// The value to set when it is not.
    pub remedy: f64,
    /// What it is for.
    pub why: &'static str,
    /// Whether it may be missing.
    pub presence: Presence,
    /// When it matters.
    pub matters: Matters,
}

/// When a parameter matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matters {
    /// Always.
    Always,
    /// While the controller hears a radio.
    WithRadio,
}

const fn rule(names: &'static [&'static str], need: Need, remedy: f64, why: &'static str) -> Rule {
    let (presence, matters) = (Presence::Required, Matters::Always);
    Rule { names, need, remedy, why, presence, matters }
}

const fn with_radio(rule: Rule) -> Rule {
    Rule { matters: Matters::WithRadio, ..rule }
}

const fn optional(rule: Rule) -> Rule {
    Rule { presence: Presence::Optional, ..rule }
}

const ONE: &[f64] = &[1.0];
const ZERO: &[f64] = &[0.0];

const PX4_SURFACES: [Rule; 8] = [
    rule(
        &["COM_RC_IN_MODE"],
        Need::OneOf(ONE),
        1.0,
        "with any other value PX4 ignores the companion's sticks, or flies on a radio's in MANUAL when the companion dies",
    ),
    rule(
        &["COM_RC_LOSS_T"],
        Need::Between(0.1, 0.5),
        0.5,
        "the controller must notice a dead companion",
    ),
    rule(
        &["NAV_RCL_ACT"],
        Need::OneOf(ONE),
        1.0,
        "the sticks end with every hand-back: the controller must hold then, not return or descend",
    ),
    rule(&["FW_MAN_R_SC"], Need::OneOf(ONE), 1.0, "full stick must be full aileron"),
    rule(&["FW_MAN_P_SC"], Need::OneOf(ONE), 1.0, "full stick must be full elevator"),
    rule(&["TRIM_ROLL"], Need::Between(-0.25, 0.25), 0.0, "it is added to the aileron"),
    rule(&["TRIM_PITCH"], Need::Between(-0.25, 0.25), 0.0, "it is added to the elevator"),
    optional(rule(&["IMU_GYRO_CUTOFF"], Need::Between(0.0, 2000.0), 40.0, FILTER)),
];

const PX4_ATTITUDE: [Rule; 2] = [
    rule(
        &["COM_OF_LOSS_T"],
        Need::Between(0.1, 0.5),
        0.5,
        "the controller must notice a dead companion",
    ),
    rule(&["COM_OBL_RC_ACT"], Need::OneOf(&[5.0]), 5.0, "it must hold, not wait for a radio"),
];

const ARDUPILOT_SURFACES: [Rule; 31] = [
    rule(
        &["RC_OVERRIDE_TIME"],
        Need::Between(0.1, 0.5),
        0.5,
        "the controller must notice a dead companion",
    ),
    rule(
        &["MAV_GCS_SYSID", "SYSID_MYGCS"],
        Need::OurSystem,
        1.0,
        "overrides of other systems are ignored",
    ),
    rule(
        &["SCHED_LOOP_RATE"],
        LOOP_RATE,
        250.0,
        "a stream is sent at 0.8 of it at most, and the loop is late by it",
    ),
    rule(&["INS_GYRO_FILTER"], Need::Between(0.0, 2000.0), 80.0, FILTER),
    rule(&["THR_FAILSAFE"], Need::OneOf(ONE), 1.0, NO_RADIO),
    rule(&["FS_SHORT_ACTN"], Need::OneOf(&[0.0, 1.0]), 0.0, NO_RADIO),
    rule(&["FS_LONG_ACTN"], Need::OneOf(&[0.0, 1.0]), 1.0, NO_RADIO),
    optional(rule(&["RC_FS_TIMEOUT"], Need::Between(0.1, 1.0), 1.0, NO_RADIO)),
    with_radio(rule(&["FS_GCS_ENABL"], Need::OneOf(&[1.0, 2.0]), 1.0, RADIO)),
    with_radio(rule(&["FS_LONG_TIMEOUT"], Need::Between(1.5, 3.0), 2.0, RADIO)),
    optional(with_radio(rule(&["MAV_GCS_SYSID_HI"], Need::OneOf(ZERO), 0.0, STATION))),
    rule(&["RC_OPTIONS"], Need::Without(2), 32.0, "bit 1 makes it ignore overrides"),
    // Until 4.7 a channel's place is RCMAP's and its option 0; later the option says it, and there is no RCMAP.
    optional(rule(&["RCMAP_ROLL"], Need::OneOf(ONE), 1.0, ROLL)),
    optional(rule(&["RCMAP_PITCH"], Need::OneOf(&[2.0]), 2.0, PITCH)),
    optional(rule(&["RCMAP_THROTTLE"], Need::OneOf(&[3.0]), 3.0, THROTTLE)),
    optional(rule(&["RC1_OPTION"], Need::OneOf(&[0.0, 201.0]), 201.0, ROLL)),
    optional(rule(&["RC2_OPTION"], Need::OneOf(&[0.0, 202.0]), 202.0, PITCH)),
    optional(rule(&["RC3_OPTION"], Need::OneOf(&[0.0, 203.0]), 203.0, THROTTLE)),
    rule(&["MAN_EXPO_ROLL"], Need::OneOf(ZERO), 0.0, "the stick must be linear"),
    rule(&["MAN_EXPO_PITCH"], Need::OneOf(ZERO), 0.0, "the stick must be linear"),
    rule(&["RC1_MIN"], Need::Pulse, 1100.0, SCALE),
    rule(&["RC1_TRIM"], Need::Pulse, 1500.0, SCALE),
    rule(&["RC1_MAX"], Need::Pulse, 1900.0, SCALE),
    rule(&["RC1_REVERSED"], Need::OneOf(&[0.0, 1.0]), 0.0, SCALE),
    rule(&["RC2_MIN"], Need::Pulse, 1100.0, SCALE),
    rule(&["RC2_TRIM"], Need::Pulse, 1500.0, SCALE),
    rule(&["RC2_MAX"], Need::Pulse, 1900.0, SCALE),
    rule(&["RC2_REVERSED"], Need::OneOf(&[0.0, 1.0]), 0.0, SCALE),
    rule(&["RC3_MIN"], Need::Pulse, 1100.0, SCALE),
    rule(&["RC3_MAX"], Need::Pulse, 1900.0, SCALE),
    rule(&["RC3_REVERSED"], Need::OneOf(&[0.0, 1.0]), 0.0, SCALE),
];
const ROLL: &str = "channel 1 is sent as roll";
const PITCH: &str = "channel 2 is sent as pitch";
const THROTTLE: &str = "channel 3 is sent as throttle";
const NO_RADIO: &str = "without a radio the controller must act when the companion is dead";
const RADIO: &str = "a radio is bound: nothing else makes ArduPlane leave MANUAL when the companion dies; or fly with --command attitude";
const STATION: &str =
    "a radio is bound: a ground station's heartbeats would hide that the companion is dead";
const FILTER: &str = "a low-pass of the gyros makes the loop late";
const SCALE: &str = "the pulses are scaled by it";
/// 100 Hz of state are 0.8 of 125 Hz; below 200 Hz nothing was flown.
const LOOP_RATE: Need = Need::Between(200.0, 2000.0);

const ARDUPILOT_ATTITUDE: [Rule; 2] = [
    rule(&["SCHED_LOOP_RATE"], LOOP_RATE, 200.0, "a stream is sent at 0.8 of it at most"),
    optional(rule(
        &["GUIDED_TIMEOUT"],
        Need::Between(0.1, 1.0),
        0.5,
        "a dead companion's last attitude is flown for so long",
    )),
];

impl Stack {
    /// MAV_AUTOPILOT.
    pub fn autopilot(self) -> u8 {
        match self {
            Stack::Px4 => 12,
            Stack::Ardupilot => 3,
        }
    }

    /// The stack of a MAV_AUTOPILOT.
    pub fn of(autopilot: u8) -> Option<Stack> {
        [Stack::Px4, Stack::Ardupilot].into_iter().find(|stack| stack.autopilot() == autopilot)
    }

    /// The mode in which the companion steers.
    pub fn steered(self, authority: Authority) -> StackMode {
        match (self, authority) {
            (Stack::Px4, Authority::Surfaces) => mode("MANUAL", 1, 0),
            (Stack::Px4, Authority::Attitude) => mode("OFFBOARD", 6, 0),
            (Stack::Ardupilot, Authority::Surfaces) => mode("MANUAL", 0, 0),
            (Stack::Ardupilot, Authority::Attitude) => mode("GUIDED", 15, 0),
        }
    }

    /// For how long commands are streamed before the steered mode is asked for. PX4 looks at its
    /// requirements every 100 ms and has sticks pass through another module first: it refused 2 of 3
    /// at 150 ms, none at 300 ms. ArduPilot asks for no stream, and mixes early sticks into LOITER.
    pub fn lead(self) -> Duration {
        match self {
            Stack::Px4 => Duration::from_millis(500),
            Stack::Ardupilot => Duration::ZERO,
        }
    }

    /// The mode in which the controller flies by itself: it is handed back in it.
    pub fn hold(self) -> StackMode {
        match self {
            Stack::Px4 => mode("HOLD", 4, 3),
            Stack::Ardupilot => mode("LOITER", 12, 0),
        }
    }

    /// What is asked for.
    pub fn streams(self) -> &'static [Stream] {
        match self {
            Stack::Px4 => &PX4_STREAMS,
            Stack::Ardupilot => &ARDUPILOT_STREAMS,
        }
    }

    /// What is checked.
    pub fn rules(self, authority: Authority) -> &'static [Rule] {
        match (self, authority) {
            (Stack::Px4, Authority::Surfaces) => &PX4_SURFACES,
            (Stack::Px4, Authority::Attitude) => &PX4_ATTITUDE,
            (Stack::Ardupilot, Authority::Surfaces) => &ARDUPILOT_SURFACES,
            (Stack::Ardupilot, Authority::Attitude) => &ARDUPILOT_ATTITUDE,
        }
    }

    /// State frames for each command that is sent: ArduPilot samples the channels at 50 Hz.
    pub fn frames_per_command(self, authority: Authority) -> u64 {
        match (self, authority) {
            (Stack::Px4, Authority::Surfaces) => 1,
            _ => 2,
        }
    }
}

impl StackMode {
    /// The `custom_mode` of a heartbeat in this mode.
    pub fn custom(self, stack: Stack) -> u32 {
        match stack {
            Stack::Px4 => u32::from(self.main) << 16 | u32::from(self.sub) << 24,
            Stack::Ardupilot => self.main.into(),
        }
    }
}

impl fmt::Display for Stack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Stack::Px4 => "PX4",
            Stack::Ardupilot => "ArduPilot",
        })
    }
}
