//! The columns of Greylag's log format: their names, and the fields of [`Sample`] that hold their values.

use super::Sample;

/// Function that reads the value of a column from a sample.
pub(super) type Get = fn(&Sample) -> f64;
/// Function that gives mutable access to the value of a column in a sample.
pub(super) type Place = fn(&mut Sample) -> &mut f64;

/// A column of the format: name, read access, mutable access.
pub(super) type Column = (&'static str, Get, Place);

/// The columns of the format in the order in which they are written.
pub(super) const COLUMNS: [Column; 29] = [
    ("time_s", |s| s.time_s, |s| &mut s.time_s),
    ("roll_rad", |s| s.attitude_rad[0], |s| &mut s.attitude_rad[0]),
    ("pitch_rad", |s| s.attitude_rad[1], |s| &mut s.attitude_rad[1]),
    ("yaw_rad", |s| s.attitude_rad[2], |s| &mut s.attitude_rad[2]),
    ("p_radps", |s| s.rates_radps[0], |s| &mut s.rates_radps[0]),
    ("q_radps", |s| s.rates_radps[1], |s| &mut s.rates_radps[1]),
    ("r_radps", |s| s.rates_radps[2], |s| &mut s.rates_radps[2]),
    ("airspeed_mps", |s| s.airspeed_mps, |s| &mut s.airspeed_mps),
    ("alpha_rad", |s| s.alpha_rad, |s| &mut s.alpha_rad),
    ("beta_rad", |s| s.beta_rad, |s| &mut s.beta_rad),
    ("ax_mps2", |s| s.specific_force_mps2[0], |s| &mut s.specific_force_mps2[0]),
    ("ay_mps2", |s| s.specific_force_mps2[1], |s| &mut s.specific_force_mps2[1]),
    ("az_mps2", |s| s.specific_force_mps2[2], |s| &mut s.specific_force_mps2[2]),
    ("vn_mps", |s| s.velocity_ned_mps[0], |s| &mut s.velocity_ned_mps[0]),
    ("ve_mps", |s| s.velocity_ned_mps[1], |s| &mut s.velocity_ned_mps[1]),
    ("vd_mps", |s| s.velocity_ned_mps[2], |s| &mut s.velocity_ned_mps[2]),
    ("altitude_m", |s| s.altitude_m, |s| &mut s.altitude_m),
    ("air_density_kgpm3", |s| s.air_density_kgpm3, |s| &mut s.air_density_kgpm3),
    ("aileron_rad", |s| s.aileron_rad, |s| &mut s.aileron_rad),
    ("elevator_rad", |s| s.elevator_rad, |s| &mut s.elevator_rad),
    ("rudder_rad", |s| s.rudder_rad, |s| &mut s.rudder_rad),
    ("throttle", |s| s.throttle, |s| &mut s.throttle),
    ("aileron_cmd", |s| s.aileron_cmd, |s| &mut s.aileron_cmd),
    ("elevator_cmd", |s| s.elevator_cmd, |s| &mut s.elevator_cmd),
    ("rudder_cmd", |s| s.rudder_cmd, |s| &mut s.rudder_cmd),
    ("throttle_cmd", |s| s.throttle_cmd, |s| &mut s.throttle_cmd),
    ("roll_target_rad", |s| s.roll_target_rad, |s| &mut s.roll_target_rad),
    ("pitch_target_rad", |s| s.pitch_target_rad, |s| &mut s.pitch_target_rad),
    ("rate_hold_s", |s| s.rate_hold_s, |s| &mut s.rate_hold_s),
];
/// Number of rows of a block. Code that evaluates every column processes the rows in blocks, all columns of one block before
/// the next block, so that a block stays in the processor's cache.
pub(super) const BLOCK: usize = 512;
/// Columns that a flight log must have.
pub(super) const NEEDED: [&str; 7] =
    ["time_s", "roll_rad", "pitch_rad", "p_radps", "q_radps", "r_radps", "airspeed_mps"];
/// Columns with the command and the position of each actuator. A flight log must have at least one of the two.
pub(super) const EITHER: [(&str, &str); 3] = [
    ("aileron_cmd", "aileron_rad"),
    ("elevator_cmd", "elevator_rad"),
    ("throttle_cmd", "throttle"),
];

/// The index of the column `name` in [`COLUMNS`].
pub(super) fn index(name: &str) -> Option<usize> {
    COLUMNS.iter().position(|c| c.0 == name)
}

/// Whether a column is a command or a commanded angle, whose value holds until the next sample.
pub(super) fn is_held(name: &str) -> bool {
    name.ends_with("_cmd") || name.ends_with("_target_rad")
}

/// Whether a column is an angle that jumps from π to −π.
pub(super) fn is_wrapped(name: &str) -> bool {
    matches!(name, "roll_rad" | "yaw_rad")
}
