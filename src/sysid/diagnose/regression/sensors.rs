//! What the sensors may still have wrong after the reconstruction.

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
    "blur_actuators",
];

/// Name of the actuators' lateness.
pub const LATE: &str = "skew_actuators";
/// Its place in [`NAMES`].
pub const LATE_PLACE: usize = SENSORS - 2;
/// Place of the actuators' blur.
pub const BLUR_PLACE: usize = SENSORS - 1;

/// Least standard deviations: rad/s, rad, a share, m/s², s; a filter that knows only its own errors states
/// less than it has.
const FLOOR: [f64; SENSORS - 3] =
    [2e-4, 2e-4, 2e-4, 1e-3, 1e-3, 3e-3, 0.01, 0.01, 0.01, 5e-4, 5e-4, 2e-3, 5e-4];
/// Prior width of the time, s, by which angular accelerations follow the moments: a simulator that steps by
/// explicit Euler at 400 Hz has 1.25 ms, a gyro's low-pass filter of 100 Hz 1.6 ms.
const MOMENTS_LATE: f64 = 1.5e-3;
/// The same where the log holds a simulator's own steps, which are compared as such.
const MOMENTS_ON_TIME: f64 = 1e-6;
/// Prior width of the actuators' clock, samples: ±1.5 samples are its 95 % interval.
const SKEW_SAMPLES: f64 = 0.77;
/// Mean and standard deviation of the actuators' blur, squared samples: a record that is late by a part of a
/// sample is anything between the value then and the mean of both samples beside it, which has 1/8.
pub const BLURRED: [f64; 2] = [1.0 / 16.0, 1.0 / 24.0];

/// What each is taken for before anything is fitted.
pub fn mean(which: usize) -> f64 {
    if which == BLUR_PLACE { BLURRED[0] } else { 0.0 }
}

/// Prior widths of the sensor errors of a flight whose samples are `dt` (s) apart.
pub fn widths(flight: &Reconstruction, dt: f64) -> [f64; SENSORS] {
    let stated = |name: &str| {
        // the vanes share a clock
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
