//! Rules that assign the fields of MAVROS's topics (ROS messages) to the columns of a log.
//!
//! MAVROS publishes in body axes forward-left-up (FLU) and earth axes east-north-up (ENU). The velocity over ground
//! (`local_position/velocity_local`) is in earth axes although its `frame_id` names the body. The airspeed of
//! `vfr_hud` is the autopilot's own equivalent airspeed.
//!
//! Not mapped: `local_position/velocity_body`, which needs the attitude of the same instant; `wind_estimation`, for
//! which the log format has no column; `rc/out` without an airframe file, because no topic states which surface a
//! channel moves.

use super::rule::{Axes, Rule, Tilt};
use super::servos;
use crate::topics::Topics;
use greylag_physics::mixer::Mixer;

/// The topics that the rules use.
pub const TOPICS: [&str; 10] = [
    "imu/data",
    "imu/data_raw",
    "vfr_hud",
    "local_position/velocity_local",
    "altitude",
    "rc/out",
    "target_actuator_control",
    "setpoint_raw/target_attitude",
    "setpoint_raw/attitude",
    "extended_state",
];

/// Fields that the rules use. A name that ends with a point or a bracket matches every field that begins with it.
const FIELDS: [&str; 10] = [
    "orientation.",
    "angular_velocity.",
    "linear_acceleration.",
    "airspeed",
    "altitude",
    "twist.linear.",
    "amsl",
    "channels[",
    "controls[",
    "vtol_state",
];

/// Whether the rules use a field.
pub fn uses(field: &str) -> bool {
    let open = |f: &str| f.ends_with(['[', '.']);
    FIELDS.iter().any(|f| if open(f) { field.starts_with(f) } else { field == *f })
}

/// Fields of an orientation, w first.
const ORIENTATION: [&str; 4] = ["orientation.w", "orientation.x", "orientation.y", "orientation.z"];

/// The rules, preferred ones first.
pub fn rules(topics: &Topics, mixer: Option<&Mixer>) -> Vec<Rule> {
    let mut out = vec![Rule::quaternion("imu/data", ORIENTATION).in_axes(Axes::EnuFlu)];
    for (rate, force, axis, gain) in [
        ("p_radps", "ax_mps2", "x", 1.0),
        ("q_radps", "ay_mps2", "y", -1.0),
        ("r_radps", "az_mps2", "z", -1.0),
    ] {
        let (rates, forces) =
            (format!("angular_velocity.{axis}"), format!("linear_acceleration.{axis}"));
        let raw = "rates are imu/data_raw's, gyro biases not removed";
        out.push(Rule::linear(rate, "imu/data", &rates, gain));
        out.push(Rule::linear(rate, "imu/data_raw", &rates, gain).noting(raw));
        out.push(Rule::linear(force, "imu/data", &forces, gain));
        out.push(Rule::linear(force, "imu/data_raw", &forces, gain));
    }
    out.push(
        Rule::linear("airspeed_mps", "vfr_hud", "airspeed", 1.0)
            .equivalent()
            .noting("airspeed is vfr_hud's equivalent airspeed, made true by the air's density"),
    );
    for (column, field, gain) in [
        ("vn_mps", "twist.linear.y", 1.0),
        ("ve_mps", "twist.linear.x", 1.0),
        ("vd_mps", "twist.linear.z", -1.0),
    ] {
        out.push(Rule::linear(column, "local_position/velocity_local", field, gain));
    }
    out.push(Rule::linear("altitude_m", "altitude", "amsl", 1.0));
    out.push(Rule::linear("altitude_m", "vfr_hud", "altitude", 1.0));
    for topic in ["setpoint_raw/target_attitude", "setpoint_raw/attitude"] {
        for (column, angle) in [("roll_target_rad", Tilt::Roll), ("pitch_target_rad", Tilt::Pitch)]
        {
            out.push(Rule::tilt(column, topic, angle, ORIENTATION).in_axes(Axes::EnuFlu));
        }
    }
    out.extend(servos::rules(topics, "rc/out", mixer, |n| format!("channels[{}]", n - 1)));
    // Roll, pitch, yaw and thrust of PX4's control group 0; pitch is positive nose up.
    for (column, i, gain) in [
        ("aileron_cmd", 0, 1.0),
        ("elevator_cmd", 1, -1.0),
        ("rudder_cmd", 2, -1.0),
        ("throttle_cmd", 3, 1.0),
    ] {
        let rule = Rule::linear(column, "target_actuator_control", &format!("controls[{i}]"), gain);
        out.push(rule.noting("commands are target_actuator_control's, before the mixer"));
    }
    out
}
