//! What the client side asks of an autopilot: the boundary between MAVLink and the pilot.

use greylag_physics::{ActuatorState, Command, Time};

/// Flight modes, with the `custom_mode` numbers PX4 uses (main mode, sub mode).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Stick deflections are surface commands. PX4 main mode 1.
    Manual,
    /// Wings level at the cruise airspeed. PX4 AUTO/LOITER, main 4 sub 3.
    Hold,
    /// Return to launch: known so that it can be refused by name. PX4 AUTO/RTL, main 4 sub 5.
    Return,
    /// Attitude setpoints from a client. PX4 main mode 6.
    Offboard,
    /// Stick deflections are roll and pitch commands. PX4 main mode 7.
    Stabilized,
}

/// The answer to a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Done.
    Accepted,
    /// Understood, not now: MAV_RESULT_TEMPORARILY_REJECTED, with the reason for a STATUSTEXT.
    Rejected(String),
    /// Understood, never like this: MAV_RESULT_DENIED, with the reason for a STATUSTEXT.
    Denied(String),
}

/// An attitude setpoint, already decoded from SET_ATTITUDE_TARGET and known to be finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeSetpoint {
    /// Commanded roll, rad, not yet limited to the envelope.
    pub roll: f64,
    /// Commanded pitch, rad, not yet limited to the envelope.
    pub pitch: f64,
    /// Commanded thrust 0..1; `None` when the sender masked it.
    pub thrust: Option<f64>,
}

/// Stick positions from MANUAL_CONTROL, −1..1 (`throttle` 0..1); positive pitch stick is nose down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sticks {
    /// Roll stick, positive right.
    pub roll: f64,
    /// Pitch stick, positive forward (nose down).
    pub pitch: f64,
    /// Throttle stick, 0..1.
    pub throttle: f64,
}

/// How urgent a text is (MAV_SEVERITY).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The aircraft is in danger.
    Critical = 2,
    /// Something failed.
    Error = 3,
    /// Something may fail.
    Warning = 4,
    /// Worth knowing.
    Notice = 5,
    /// For the record.
    Info = 6,
}

/// A line for the ground station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text {
    /// How urgent it is.
    pub severity: Severity,
    /// The words, of any length (they are sent in chunks of 50).
    pub words: String,
}

/// A parameter's value in its MAVLink type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterValue {
    /// MAV_PARAM_TYPE_REAL32.
    Real(f32),
    /// MAV_PARAM_TYPE_INT32, sent bytewise in the float field.
    Int(i32),
}

/// One entry of the parameter table; its place in the table is its index.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// At most 16 ASCII characters.
    pub name: &'static str,
    /// The value in force.
    pub value: ParameterValue,
}

/// Everything that the streams to a client are made of. A value that is not known is NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// The mode in force.
    pub mode: Mode,
    /// Whether actuator outputs are live.
    pub armed: bool,
    /// Whether a failsafe is in force (MAV_STATE_CRITICAL).
    pub failsafe: bool,
    /// Whether the vehicle link delivers fresh state.
    pub vehicle_alive: bool,
    /// Euler angles roll, pitch, yaw, rad.
    pub attitude: [f64; 3],
    /// Body rates p, q, r, rad/s.
    pub rates: [f64; 3],
    /// True airspeed, m/s.
    pub airspeed: f64,
    /// Altitude above mean sea level, m.
    pub altitude: f64,
    /// Latitude and longitude, degrees.
    pub position: [f64; 2],
    /// Velocity over ground, NED, m/s.
    pub velocity: [f64; 3],
    /// The attitude commanded now (roll, pitch), rad, after the envelope.
    pub target: [f64; 2],
    /// The command in force.
    pub command: Command,
    /// The observed actuator state.
    pub actuators: ActuatorState,
    /// Share of the 10 ms cycle the control task needed lately, 0..1.
    pub load: f64,
    /// What is measured less what the model predicts, divided by the half width of its band (two standard deviations,
    /// see `flight::monitor`), in the order of [`RESIDUALS`]; no unit, beyond −1..1 is outside.
    pub residuals: [f64; 6],
}

/// Names of the residuals: specific forces along body x, y, z, then angular accelerations.
pub const RESIDUALS: [&str; 6] = ["res_fx", "res_fy", "res_fz", "res_roll", "res_pitch", "res_yaw"];

/// An autopilot as the client side sees it. Implemented by `flight::pilot::Pilot`, and by a double
/// in the tests of the protocol.
pub trait Autopilot {
    /// Makes actuator outputs live; `force` skips the checks.
    fn arm(&mut self, now: Time, force: bool) -> Verdict;
    /// Makes actuator outputs dead; `force` does so in the air.
    fn disarm(&mut self, now: Time, force: bool) -> Verdict;
    /// Changes the mode.
    fn set_mode(&mut self, now: Time, mode: Mode) -> Verdict;
    /// A valid attitude setpoint has arrived (it also proves the sender alive).
    fn attitude_setpoint(&mut self, now: Time, setpoint: AttitudeSetpoint);
    /// Stick positions have arrived.
    fn sticks(&mut self, now: Time, sticks: Sticks);
    /// The parameter table: stable in length and order.
    fn parameters(&self) -> &[Parameter];
    /// Sets a parameter; the verdict says why not. The type given has been matched to the table's.
    fn set_parameter(&mut self, index: usize, value: ParameterValue) -> Verdict;
    /// What the streams are made of.
    fn status(&self) -> Status;
    /// Takes the oldest line waiting for the ground stations.
    fn take_text(&mut self) -> Option<Text>;
}
