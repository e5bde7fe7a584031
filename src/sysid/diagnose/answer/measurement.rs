//! Sensor errors and wind, as the reconstruction decided them before any aerodynamics.

use crate::diagnose::answer::result::Measurement;
use crate::flight_path::reconstruction::{Nuisance, Reconstruction};

/// A constant's prefix, its id in the catalogue, its nominal value, what its kind allows.
const KINDS: [(&str, &str, f64, f64); 9] = [
    ("gyro_bias", "imu_bias", 0.0, 0.02),
    ("gyro_drift", "imu_bias", 0.0, 5e-5),
    ("accelerometer_bias", "imu_bias", 0.0, 0.3),
    ("alpha_bias", "alpha_bias", 0.0, 0.026),
    ("beta_bias", "beta_bias", 0.0, 0.026),
    ("airspeed_scale", "airspeed_scale", 1.0, 0.05),
    ("wind_", "steady_wind", 0.0, 1.0),
    ("skew_actuators", "actuators_late", 0.0, 0.015),
    ("skew_", "clock_skew", 0.0, 0.015),
];
/// Standard deviations beyond which a constant is clearly not zero.
const CLEARLY: f64 = 4.0;

/// What each flight's sensors and wind were. Late actuators may as well be the aircraft's, which the
/// search for effects decides, so they are not asserted.
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
