//! Plausibility limits of the vehicle's telemetry. A value beyond its limit indicates a fault of a sensor or of the link.

use std::fmt;
use std::ops::RangeInclusive;

use greylag_physics::servos::Travels;

/// A set of faults: parts of a state frame (the vehicle's state at one instant) that are implausible or stale.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults(u8);

impl Faults {
    /// The empty set of faults.
    pub const NONE: Faults = Faults(0);
    /// The attitude is implausible.
    pub const ATTITUDE: Faults = Faults(1);
    /// The body rates are implausible.
    pub const RATES: Faults = Faults(2);
    /// The airspeed or the altitude is implausible.
    pub const AIR: Faults = Faults(4);
    /// The angle of attack or the sideslip is implausible.
    pub const INCIDENCE: Faults = Faults(8);
    /// The specific force is implausible.
    pub const SPECIFIC_FORCE: Faults = Faults(16);
    /// The actuator state is implausible.
    pub const ACTUATORS: Faults = Faults(32);
    /// Airspeed and altitude are stale.
    pub const LATE_AIR: Faults = Faults(64);

    const NAMES: [(Faults, &'static str); 7] = [
        (Faults::ATTITUDE, "attitude"),
        (Faults::RATES, "body rates"),
        (Faults::AIR, "airspeed or altitude"),
        (Faults::INCIDENCE, "incidence"),
        (Faults::SPECIFIC_FORCE, "specific force"),
        (Faults::ACTUATORS, "actuators"),
        (Faults::LATE_AIR, "airspeed and altitude late"),
    ];

    /// Whether the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether the set contains any fault of `other`.
    pub fn contains(self, other: Faults) -> bool {
        self.0 & other.0 != 0
    }

    /// Adds the faults of `other`.
    pub fn insert(&mut self, other: Faults) {
        self.0 |= other.0;
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = Faults::NAMES
            .iter()
            .filter(|(fault, _)| self.contains(*fault))
            .map(|(_, n)| *n)
            .collect();
        f.write_str(&names.join(", "))
    }
}

/// Plausible body rates, rad/s. Common gyroscopes have a full scale of 2000 °/s, 35 rad/s.
const RATE: RangeInclusive<f64> = -40.0..=40.0;
/// Plausible airspeed, m/s. A small aircraft never reaches 150 m/s. Values a little below zero are sensor noise.
const AIRSPEED: RangeInclusive<f64> = -5.0..=150.0;
/// Plausible altitude above mean sea level, m.
const ALTITUDE: RangeInclusive<f64> = -1000.0..=20_000.0;
/// Plausible angle of attack and sideslip, rad: ±180° with a tolerance for rounding.
const INCIDENCE: RangeInclusive<f64> = -3.15..=3.15;
/// Plausible specific force along each body axis, m/s²: about ±50 g.
const FORCE: RangeInclusive<f64> = -500.0..=500.0;
/// Plausible normalised deflection (−1..1), with a tolerance for noise.
const DEFLECTION: RangeInclusive<f64> = -1.5..=1.5;
/// Plausible travel of a surface to each side, rad: above zero and at most about 90°.
const TRAVEL: RangeInclusive<f64> = 0.001..=1.6;
/// Plausible throttle position (0..1), with a tolerance for noise.
const THROTTLE: RangeInclusive<f64> = -0.25..=1.25;
/// Plausible rate of the normalised deflection, 1/s. Real actuators are far slower.
const DEFLECTION_RATE: RangeInclusive<f64> = -1000.0..=1000.0;

// All checks below return false for NaN, because no range contains NaN.

/// Whether the body rates p, q, r, rad/s, are plausible.
pub fn rates(values: [f64; 3]) -> bool {
    values.iter().all(|x| RATE.contains(x))
}
/// Whether airspeed (m/s) and altitude (m) are plausible.
pub fn air(airspeed: f64, altitude: f64) -> bool {
    AIRSPEED.contains(&airspeed) && ALTITUDE.contains(&altitude)
}
/// Whether α and β, rad, are plausible.
pub fn incidence(alpha: f64, beta: f64) -> bool {
    INCIDENCE.contains(&alpha) && INCIDENCE.contains(&beta)
}
/// Whether the specific force in body axes, m/s², is plausible.
pub fn specific_force(values: [f64; 3]) -> bool {
    values.iter().all(|x| FORCE.contains(x))
}
/// Whether positions and rates of the actuators are plausible, in the order aileron, elevator, throttle, aileron rate, elevator
/// rate, rudder, rudder rate (normalised; rates in 1/s).
pub fn actuators(
    [aileron, elevator, throttle, aileron_rate, elevator_rate, rudder, rudder_rate]: [f64; 7],
) -> bool {
    [aileron, elevator, rudder].iter().all(|x| DEFLECTION.contains(x))
        && THROTTLE.contains(&throttle)
        && [aileron_rate, elevator_rate, rudder_rate].iter().all(|x| DEFLECTION_RATE.contains(x))
}
/// Whether the travel of each surface is plausible to both sides.
pub fn travels(travels: &Travels) -> bool {
    let Travels { aileron, elevator, rudder } = travels;
    let mut all = [Some(*aileron), Some(*elevator), *rudder].into_iter().flatten();
    all.all(|travel| TRAVEL.contains(&travel.most) && TRAVEL.contains(&-travel.least))
}
/// Whether latitude and longitude, degrees, are plausible.
pub fn position([latitude, longitude]: [f64; 2]) -> bool {
    latitude.abs() <= 90.0 && longitude.abs() <= 180.0
}
/// Whether a velocity over ground, m/s, is plausible: at most 250 m/s in each component. This is the largest plausible airspeed
/// plus the largest plausible wind.
pub fn ground_velocity(values: [f64; 3]) -> bool {
    values.iter().all(|x| x.abs() <= 250.0)
}
/// Whether a wind velocity, m/s, is plausible: at most 100 m/s in each component.
pub fn wind(values: [f64; 3]) -> bool {
    values.iter().all(|x| x.abs() <= 100.0)
}
