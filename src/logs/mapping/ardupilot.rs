//! Rules by which ArduPilot's DataFlash records fill the columns of the table.
//!
//! Differential spoilers and the wind of XKF2 are not mapped. V-tails and several motors are mapped only by the mixer of the
//! airframe file.

use super::rule::Rule;
use super::servos;
use crate::topics::Topics;
use greylag_physics::mixer::Mixer;

/// The record types that the rules use.
pub const TOPICS: [&str; 13] = [
    "ATT", "IMU", "ARSP", "AOA", "BARO", "XKF1", "NKF1", "POS", "RCOU", "AETR", "CTUN", "MODE",
    "QTUN",
];

/// Value of AETR at full deflection, centidegrees.
const FULL: f64 = 4500.0;

/// The rules. If several rules fill the same column, the first one is preferred.
pub fn rules(topics: &Topics, mixer: Option<&Mixer>) -> Vec<Rule> {
    let degree = 1_f64.to_radians();
    let mut out = Vec::new();
    for (column, topic, field, gain) in [
        ("roll_rad", "ATT", "Roll", degree),
        ("pitch_rad", "ATT", "Pitch", degree),
        ("yaw_rad", "ATT", "Yaw", degree),
        ("p_radps", "IMU", "GyrX", 1.0),
        ("q_radps", "IMU", "GyrY", 1.0),
        ("r_radps", "IMU", "GyrZ", 1.0),
        ("ax_mps2", "IMU", "AccX", 1.0),
        ("ay_mps2", "IMU", "AccY", 1.0),
        ("az_mps2", "IMU", "AccZ", 1.0),
        ("vn_mps", "XKF1", "VN", 1.0),
        ("ve_mps", "XKF1", "VE", 1.0),
        ("vd_mps", "XKF1", "VD", 1.0),
        ("vn_mps", "NKF1", "VN", 1.0),
        ("ve_mps", "NKF1", "VE", 1.0),
        ("vd_mps", "NKF1", "VD", 1.0),
        ("altitude_m", "POS", "Alt", 1.0),
        ("roll_target_rad", "ATT", "DesRoll", degree),
        ("pitch_target_rad", "ATT", "DesPitch", degree),
    ] {
        out.push(Rule::linear(column, topic, field, gain));
    }
    let note = "airspeed is ARSP's equivalent airspeed, made true by the air's density";
    out.push(Rule::linear("airspeed_mps", "ARSP", "Airspeed", 1.0).equivalent().noting(note));
    let note = "airspeed is CTUN's equivalent airspeed (sensor or estimate), made true by the air's density";
    out.push(Rule::linear("airspeed_mps", "CTUN", "As", 1.0).equivalent().noting(note));
    for (column, field) in [("alpha_rad", "AOA"), ("beta_rad", "SSA")] {
        let note = "alpha and beta are ArduPilot's estimates from velocity and wind, not vanes";
        out.push(Rule::linear(column, "AOA", field, degree).noting(note));
    }
    out.push(Rule::density("BARO", ("Press", 1.0), ("Temp", 1.0)).noting(
        "air density is from BARO's pressure with its sensor's temperature, which runs warm",
    ));
    // In AETR, positive elevator is nose up and positive rudder nose right.
    for (column, field, gain) in [
        ("aileron_cmd", "Ail", 1.0 / FULL),
        ("elevator_cmd", "Elev", -1.0 / FULL),
        ("rudder_cmd", "Rudd", -1.0 / FULL),
        ("throttle_cmd", "Thr", 0.01),
    ] {
        out.push(Rule::linear(column, "AETR", field, gain));
    }
    out.extend(servos::rules(topics, "RCOU", mixer, |n| format!("C{n}")));
    out
}
