//! Sensor errors and wind of each flight. The flight-path reconstruction estimates them from kinematics, without
//! aerodynamics.

use crate::diagnose::answer::result::Measurement;
use crate::flight_path::reconstruction::{Nuisance, Reconstruction};

/// Kinds of estimated constants (sensor errors, wind), each with the prefix of its name, its identifier in the catalogue of
/// effects and measurement errors, its nominal value, and the largest negligible deviation from that value, in the constant's
/// unit. Errors of the reconstruction and usual trims cause deviations of this size.
const KINDS: [(&str, &str, f64, f64); 16] = [
    ("gyro_bias", "imu_bias", 0.0, 0.005),
    ("gyro_drift", "imu_bias", 0.0, 5e-5),
    ("accelerometer_bias", "imu_bias", 0.0, 0.1),
    ("alpha_bias", "alpha_bias", 0.0, 0.005),
    ("beta_bias", "beta_bias", 0.0, 0.005),
    ("alpha_gain", "vane_gain", 0.0, 0.01),
    ("beta_gain", "vane_gain", 0.0, 0.01),
    ("gyro_gain", "imu_gain", 0.0, 0.01),
    ("accelerometer_gain", "imu_gain", 0.0, 0.01),
    ("airspeed_offset", "airspeed_offset", 0.0, 0.3),
    ("heading_offset", "heading_offset", 0.0, 0.026),
    ("board_roll", "vanes_askew", 0.0, 0.0087),
    ("airspeed_scale", "airspeed_scale", 1.0, 0.01),
    ("wind_", "steady_wind", 0.0, 0.5),
    ("skew_actuators", "actuators_late", 0.0, 0.015),
    ("skew_", "clock_skew", 0.0, 0.005),
];
/// A constant differs significantly from its nominal value if the deviation exceeds this number of standard deviations.
const CLEARLY: f64 = 4.0;

/// Returns the sensor errors and the wind of each flight.
///
/// A delay of the recorded actuator positions is never asserted here, because it may be a property of the aircraft. The
/// search for missing effects decides on it.
pub fn measurement(flights: &[&Reconstruction]) -> Vec<Measurement> {
    let of = |flight: &&Reconstruction| {
        let name = flight.name.clone();
        flight.nuisances.iter().filter_map(move |n| one(&name, n)).collect::<Vec<_>>()
    };
    flights.iter().flat_map(of).collect()
}

fn one(flight: &str, n: &Nuisance) -> Option<Measurement> {
    let (_, id, nominal, allowed) = KINDS.iter().find(|(prefix, ..)| n.name.starts_with(prefix))?;
    let off = (n.value - nominal).abs();
    let decided = *id != "actuators_late";
    Some(Measurement {
        flight: flight.into(),
        id: if decided { (*id).into() } else { "clock_skew".into() },
        name: n.name.clone(),
        value: n.value,
        sd: n.sd,
        unit: n.unit.into(),
        asserted: decided && off > CLEARLY * n.sd && off > *allowed,
    })
}
