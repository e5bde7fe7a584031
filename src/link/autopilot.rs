//! The interface through which MAVLink clients (ground stations and offboard programs) use the autopilot. The protocol code knows
//! only this interface and not the pilot, which is the flight logic of the companion.

use greylag_physics::{ActuatorState, Command, Time};

/// Flight modes, with their `custom_mode` numbers in PX4 (main mode, sub mode).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Sticks command the surfaces directly. PX4 main mode 1.
    Manual,
    /// Wings level at the cruise airspeed. PX4 AUTO/LOITER, main 4 sub 3.
    Hold,
    /// Return to launch. Requests of this mode are always refused. PX4 AUTO/RTL, main 4 sub 5.
    Return,
    /// Attitude setpoints from a client. PX4 main mode 6.
    Offboard,
    /// Sticks command roll and pitch. PX4 main mode 7.
    Stabilized,
}

/// Result of a client's request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The request was carried out (MAV_RESULT_ACCEPTED).
    Accepted,
    /// Refused in the present state (MAV_RESULT_TEMPORARILY_REJECTED), with the reason for a STATUSTEXT.
    Rejected(String),
    /// Refused in any state (MAV_RESULT_DENIED), with the reason for a STATUSTEXT.
    Denied(String),
}

/// An attitude setpoint from SET_ATTITUDE_TARGET. All its values are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeSetpoint {
    /// Commanded roll, rad, not yet limited to the envelope.
    pub roll: f64,
    /// Commanded pitch, rad, not yet limited to the envelope.
    pub pitch: f64,
    /// Commanded thrust, 0..1; `None` if the sender's type mask excludes it.
    pub thrust: Option<f64>,
}

/// Stick positions from MANUAL_CONTROL, normalised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sticks {
    /// Roll stick, −1..1, positive right.
    pub roll: f64,
    /// Pitch stick, −1..1, positive forward (nose down).
    pub pitch: f64,
    /// Throttle stick position, 0..1.
    pub throttle: f64,
}

/// Severity of a text (MAV_SEVERITY).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The aircraft is in danger (MAV_SEVERITY_CRITICAL).
    Critical = 2,
    /// An action failed (MAV_SEVERITY_ERROR).
    Error = 3,
    /// A failure is possible (MAV_SEVERITY_WARNING).
    Warning = 4,
    /// An unusual event (MAV_SEVERITY_NOTICE).
    Notice = 5,
    /// An event of normal operation (MAV_SEVERITY_INFO).
    Info = 6,
}

/// A text for the ground stations, sent as STATUSTEXT.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text {
    /// Severity of the text.
    pub severity: Severity,
    /// The text. Up to 400 characters are sent, in chunks of 50 characters. A longer text is cut and ends with `...`.
    pub words: String,
}

/// A parameter's value in its MAVLink type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterValue {
    /// A 32-bit float (MAV_PARAM_TYPE_REAL32).
    Real(f32),
    /// An integer (MAV_PARAM_TYPE_INT32). Its bytes are sent in the float field.
    Int(i32),
}

/// One entry of the parameter table. Its index is its position in the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name of the parameter, at most 16 ASCII characters.
    pub name: &'static str,
    /// Present value of the parameter.
    pub value: ParameterValue,
}

/// The autopilot's state, from which telemetry streams are built. Unknown values are NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// The active flight mode.
    pub mode: Mode,
    /// Whether actuator outputs are enabled.
    pub armed: bool,
    /// Whether a failsafe is active (MAV_STATE_CRITICAL).
    pub failsafe: bool,
    /// Whether the vehicle link delivers fresh states.
    pub vehicle_alive: bool,
    /// Euler angles roll, pitch, yaw, rad.
    pub attitude: [f64; 3],
    /// Body rates p, q, r, rad/s.
    pub rates: [f64; 3],
    /// True airspeed V_a, m/s.
    pub airspeed: f64,
    /// Altitude above mean sea level, m.
    pub altitude: f64,
    /// Latitude and longitude, degrees.
    pub position: [f64; 2],
    /// Velocity over ground, NED, m/s.
    pub velocity: [f64; 3],
    /// Commanded roll and pitch after envelope limits, rad; NaN without a target.
    pub target: [f64; 2],
    /// The last actuator command.
    pub command: Command,
    /// The observed actuator state: surfaces in rad and rad/s, throttle 0..1.
    pub actuators: ActuatorState,
    /// Recent processing time of the control task as a fraction of its 10 ms cycle, 0..1.
    pub load: f64,
    /// Residuals of the model monitor (measured minus predicted acceleration) in the order of [`RESIDUALS`]. Each is divided by
    /// two standard deviations of the prediction, the half width of its band, and is dimensionless. A magnitude above 1 is
    /// outside the band.
    pub residuals: [f64; 6],
    /// Dimensional derivatives of the aircraft at its cruise airspeed, estimated in flight, in the order of
    /// [`ESTIMATES`]: rad/s² at full deflection for L_δa and M_δe, 1/s for L_p, 1/s² for M_α.
    pub derivatives: [f64; ESTIMATES.len()],
}

/// Names of the residuals: specific forces along body x, y and z, then angular accelerations about these axes.
pub const RESIDUALS: [&str; 6] = ["res_fx", "res_fy", "res_fz", "res_roll", "res_pitch", "res_yaw"];

/// Names of the estimated derivatives L_δa, L_p, M_δe and M_α.
pub const ESTIMATES: [&str; 4] = ["est_L_da", "est_L_p", "est_M_de", "est_M_a"];

/// An autopilot as its clients see it. It is implemented by `flight::pilot::Pilot` and by a test double in the protocol tests.
/// `now` is the vehicle time.
pub trait Autopilot {
    /// Enables the actuator outputs. `force` skips the pre-arm checks.
    fn arm(&mut self, now: Time, force: bool) -> Verdict;
    /// Disables the actuator outputs. In flight this requires `force`.
    fn disarm(&mut self, now: Time, force: bool) -> Verdict;
    /// Requests a flight mode.
    fn set_mode(&mut self, now: Time, mode: Mode) -> Verdict;
    /// Passes a valid attitude setpoint and restarts the timeout for missing setpoints.
    fn attitude_setpoint(&mut self, now: Time, setpoint: AttitudeSetpoint);
    /// Passes stick positions and restarts the timeout for missing stick positions.
    fn sticks(&mut self, now: Time, sticks: Sticks);
    /// The parameter table. Its length and order never change.
    fn parameters(&self) -> &[Parameter];
    /// Sets the parameter with index `index`. `value` must have the type of the parameter's present value. A refusal contains
    /// the reason.
    fn set_parameter(&mut self, index: usize, value: ParameterValue) -> Verdict;
    /// The present state, for telemetry streams.
    fn status(&self) -> Status;
    /// Removes and returns the oldest queued text for the ground stations.
    fn take_text(&mut self) -> Option<Text>;
}
