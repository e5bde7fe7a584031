//! Priors of the sensor errors that remain after the flight-path reconstruction. The prefix `skew` denotes a delay.

use crate::diagnose::regression::columns::SENSORS;
use crate::flight_path::reconstruction::Reconstruction;
use greylag_logs::Sampling;

/// Names of the sensor errors, in the order of [`Ready::sensors`](super::columns::Ready::sensors).
pub const NAMES: [&str; SENSORS] = [
    "gyro_bias_p",
    "gyro_bias_q",
    "gyro_bias_r",
    "alpha_bias",
    "beta_bias",
    "airspeed_scale",
    "accelerometer_bias_x",
    "accelerometer_bias_y",
    "accelerometer_bias_z",
    "skew_alpha",
    "skew_beta",
    "skew_airspeed",
    "skew_accelerometer",
    "skew_moments",
    LATE,
    BLUR,
];

/// Name of the averaging of the actuator record.
pub const BLUR: &str = "blur_actuators";
/// Name of the delay of the actuator record.
pub const LATE: &str = "skew_actuators";
/// Index of the delay of the actuator record in [`NAMES`].
pub const LATE_PLACE: usize = SENSORS - 2;
/// Index of the averaging ("blur") of the actuator record in [`NAMES`]. The averaging is half of the variance of the times
/// over which the recorder averages a deflection.
pub const BLUR_PLACE: usize = SENSORS - 1;

/// Smallest prior standard deviations (rad/s, rad, relative, m/s², s), in the order of [`NAMES`]. Smaller standard deviations
/// of the reconstruction are not used, because they cover only modelled errors.
const FLOOR: [f64; SENSORS - 3] =
    [2e-4, 2e-4, 2e-4, 1e-3, 1e-3, 3e-3, 0.01, 0.01, 0.01, 5e-4, 5e-4, 2e-3, 5e-4];
/// Prior standard deviation of the delay of angular accelerations relative to the moments, s. The delay is 1.25 ms in a
/// simulator with explicit Euler steps at 400 Hz, and 1.6 ms with a gyro's low-pass filter of 100 Hz.
const MOMENTS_LATE: f64 = 1.5e-3;
/// Prior standard deviation of the same delay if the log holds the steps of a simulator, s.
const MOMENTS_ON_TIME: f64 = 1e-6;
/// Prior standard deviation of the delay of the actuator record, in sampling intervals. The 95 % interval is ±1.5
/// sampling intervals.
const SKEW_SAMPLES: f64 = 0.77;
/// Prior mean and standard deviation of the averaging of the actuator record, in squared sampling intervals. A record
/// that is late by a fraction of the interval lies between a single sample (averaging 0) and the mean of two adjacent
/// samples (averaging 1/8).
pub const BLURRED: [f64; 2] = [1.0 / 16.0, 1.0 / 24.0];

/// Prior mean of the sensor error with the index `which`, in its unit.
pub fn mean(which: usize) -> f64 {
    if which == BLUR_PLACE { BLURRED[0] } else { 0.0 }
}

/// Prior standard deviations of the sensor errors of a flight with the sampling interval `dt` (s), in their units.
pub fn widths(flight: &Reconstruction, dt: f64) -> [f64; SENSORS] {
    let stated = |name: &str| {
        // both vanes have the same delay
        let name = if matches!(name, "skew_alpha" | "skew_beta") { "skew_vanes" } else { name };
        flight.deviation(name).unwrap_or(0.0)
    };
    std::array::from_fn(|k| match FLOOR.get(k) {
        Some(floor) => stated(NAMES[k]).max(*floor),
        None if NAMES[k] == LATE => SKEW_SAMPLES * dt,
        None if k < LATE_PLACE => match flight.sampling {
            Sampling::Instants => MOMENTS_LATE,
            Sampling::Held => MOMENTS_ON_TIME,
        },
        None => BLURRED[1],
    })
}
