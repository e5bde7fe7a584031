//! Modes, telemetry streams and parameters of each flight stack (PX4 and ArduPilot).
//!
//! Engagement is the moment at which the companion (Greylag's autopilot) takes control authority from the flight controller.

use std::fmt;
use std::time::Duration;

use greylag_physics::airframe::ActuatorFigures;

/// A flight stack that the companion supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stack {
    /// PX4 for fixed-wing aircraft.
    Px4,
    /// ArduPilot Plane (ArduPlane).
    Ardupilot,
}

/// Quantities that the companion commands to the flight controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Authority {
    /// Surfaces and throttle, as stick positions in MANUAL.
    Surfaces,
    /// Attitude and thrust, in OFFBOARD or GUIDED. The flight controller's loops command the surfaces.
    Attitude,
}

/// Flight stack and authority of a real flight controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Flight stack of the controller.
    pub stack: Stack,
    /// Quantities that the companion commands.
    pub authority: Authority,
    /// Actuator dynamics of the aircraft. The controller does not report actuator states.
    pub actuators: ActuatorFigures,
}

/// A mode in the numbers of its flight stack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StackMode {
    /// Name of the mode in ground stations.
    pub name: &'static str,
    /// PX4's main mode, or ArduPilot's mode number.
    pub main: u8,
    /// PX4's sub mode; 0 for ArduPilot.
    pub sub: u8,
}

const fn mode(name: &'static str, main: u8, sub: u8) -> StackMode {
    StackMode { name, main, sub }
}

/// A telemetry stream to request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stream {
    /// Message id of the stream.
    pub id: u32,
    /// Name of the message in texts.
    pub name: &'static str,
    /// Requested rate, Hz.
    pub hz: f64,
    /// Whether the companion engages only if it receives this stream.
    pub needed: bool,
    /// Frame length in MAVLink 2 without truncation, bytes.
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
    // reports whether the controller receives an RC transmitter
    stream(1, "SYS_STATUS", 1.0, false, 43),
];

/// Constraint on a parameter's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Need {
    /// One of these values.
    OneOf(&'static [f64]),
    /// A value in this closed interval.
    Between(f64, f64),
    /// The system id of the companion, which equals that of the controller.
    OurSystem,
    /// A plausible pulse width of an RC channel, µs. The companion scales its stick commands with the value.
    Pulse,
    /// A bit mask without any of these bits.
    Without(u32),
}

/// Whether the firmware may lack a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Firmware without the parameter does not fit the profile.
    Required,
    /// Some releases lack the parameter.
    Optional,
}

/// A parameter that is checked before engagement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// Names of the parameter, newest release first. One of them suffices.
    pub names: &'static [&'static str],
    /// Constraint on the value.
    pub need: Need,
    /// Value to set if the constraint is violated.
    pub remedy: f64,
    /// Purpose of the parameter, as text.
    pub why: &'static str,
    /// Whether the firmware may lack the parameter.
    pub presence: Presence,
    /// Condition under which the parameter is checked.
    pub matters: Matters,
}

/// Condition under which a parameter is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matters {
    /// The parameter is checked under all conditions.
    Always,
    /// The parameter is checked only while the controller receives an RC transmitter.
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
    // Until ArduPilot 4.7, RCMAP_* assigns the channels and RCn_OPTION is 0. Later releases assign them by RCn_OPTION
    // and have no RCMAP_*.
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
/// Loop rate of the flight controller, Hz. States at 100 Hz need a loop of 125 Hz, because ArduPilot sends a stream at no more
/// than 0.8 of the loop rate. Rates below 200 Hz were not flown.
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
    /// The number of the stack in MAV_AUTOPILOT.
    pub fn autopilot(self) -> u8 {
        match self {
            Stack::Px4 => 12,
            Stack::Ardupilot => 3,
        }
    }

    /// The stack with this number in MAV_AUTOPILOT; `None` if it is neither PX4 nor ArduPilot.
    pub fn of(autopilot: u8) -> Option<Stack> {
        [Stack::Px4, Stack::Ardupilot].into_iter().find(|stack| stack.autopilot() == autopilot)
    }

    /// The mode in which the companion has control authority.
    pub fn steered(self, authority: Authority) -> StackMode {
        match (self, authority) {
            (Stack::Px4, Authority::Surfaces) => mode("MANUAL", 1, 0),
            (Stack::Px4, Authority::Attitude) => mode("OFFBOARD", 6, 0),
            (Stack::Ardupilot, Authority::Surfaces) => mode("MANUAL", 0, 0),
            (Stack::Ardupilot, Authority::Attitude) => mode("GUIDED", 15, 0),
        }
    }

    /// Time for which commands are sent before the mode of [`Stack::steered`] is requested. PX4 checks its requirements every
    /// 100 ms, and its stick input first passes through another module. It refused 2 of 3 requests after 150 ms, and none after
    /// 300 ms. ArduPilot requires no commands before the request; sticks sent early would act in LOITER.
    pub fn lead(self) -> Duration {
        match self {
            Stack::Px4 => Duration::from_millis(500),
            Stack::Ardupilot => Duration::ZERO,
        }
    }

    /// The mode that is requested when control authority is returned.
    pub fn hold(self) -> StackMode {
        match self {
            Stack::Px4 => mode("HOLD", 4, 3),
            Stack::Ardupilot => mode("LOITER", 12, 0),
        }
    }

    /// The telemetry streams to request.
    pub fn streams(self) -> &'static [Stream] {
        match self {
            Stack::Px4 => &PX4_STREAMS,
            Stack::Ardupilot => &ARDUPILOT_STREAMS,
        }
    }

    /// The parameters to check before engagement.
    pub fn rules(self, authority: Authority) -> &'static [Rule] {
        match (self, authority) {
            (Stack::Px4, Authority::Surfaces) => &PX4_SURFACES,
            (Stack::Px4, Authority::Attitude) => &PX4_ATTITUDE,
            (Stack::Ardupilot, Authority::Surfaces) => &ARDUPILOT_SURFACES,
            (Stack::Ardupilot, Authority::Attitude) => &ARDUPILOT_ATTITUDE,
        }
    }

    /// Number of state frames (100 Hz) per command. ArduPilot samples its channels at 50 Hz. Attitudes are sent at 50 Hz to
    /// both stacks.
    pub fn frames_per_command(self, authority: Authority) -> u64 {
        match (self, authority) {
            (Stack::Px4, Authority::Surfaces) => 1,
            _ => 2,
        }
    }
}

impl StackMode {
    /// The `custom_mode` of this mode in a heartbeat of `stack`.
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
