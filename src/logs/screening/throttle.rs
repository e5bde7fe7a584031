//! Checks whether a throttle column is inverted, 0 at full power.
//!
//! Thrust pushes the aircraft forward and feeds its energy, whatever the coefficients. In right logs of real and simulated aircraft the
//! partial correlation of the forward specific force with the throttle was 0.87 and more, that of the energy's rate 0.4 and more.
//! Both must be negative, because the first one also is if the accelerometer is reversed.

use super::cured_by;
use super::held::held;
use super::relation::{mean, partial_correlation, windows};
use crate::Sample;
use crate::finding::{Cure, Finding};
use greylag_physics::atmosphere::STANDARD_GRAVITY;

/// Columns of the check, and least time between its rows, s.
const COLUMNS: [&str; 6] =
    ["airspeed_mps", "altitude_m", "ax_mps2", "az_mps2", "throttle", "throttle_cmd"];
const EVERY_S: f64 = 0.0199;
/// Windows over which the force and the change of energy are averaged, s.
const FORCE_S: f64 = 0.5;
const ENERGY_S: f64 = 1.0;
/// Partial correlations below which both contradict the throttle.
const FORCE: f64 = -0.7;
const ENERGY: f64 = -0.3;

type Get = fn(&Sample) -> f64;

/// A finding for each inverted column of the throttle. `rows` have right units and axes.
pub fn check(rows: &[Sample]) -> Vec<Finding> {
    let columns: [(&str, Get); 2] =
        [("throttle", |s| s.throttle), ("throttle_cmd", |s| s.throttle_cmd)];
    let rows = held(rows, &COLUMNS, EVERY_S);
    let inverted = |get: Get| {
        force(&rows, get).is_some_and(|r| r < FORCE)
            && energy(&rows, get).is_some_and(|r| r < ENERGY)
    };
    let found = columns.into_iter().filter(|(_, get)| inverted(*get));
    found
        .map(|(column, _)| {
            let what = format!(
                "{column} acts the other way: the aircraft gains speed and height where it is small, while the log format's is 1 at full power"
            );
            cured_by(what, Cure { offset: 1.0, ..Cure::factor(column, -1.0) })
        })
        .collect()
}

/// The partial correlation of the forward specific force with the throttle, beside V², lift and induced drag.
fn force(rows: &[Sample], throttle: Get) -> Option<f64> {
    let one = |w: &[Sample]| {
        let induced =
            mean(w, |s| s.specific_force_mps2[2].powi(2)) / mean(w, |s| s.airspeed_mps.powi(2));
        let speed = mean(w, |s| s.airspeed_mps.powi(2));
        let lift = mean(w, |s| s.specific_force_mps2[2]);
        (vec![speed, lift, induced, mean(w, throttle)], mean(w, |s| s.specific_force_mps2[0]))
    };
    correlation(windows(rows, FORCE_S).into_iter().map(one))
}

/// The partial correlation of the rate of the specific energy V²/2 + g h with the throttle, beside V³. The rate is the difference of
/// the means of the halves of a window.
fn energy(rows: &[Sample], throttle: Get) -> Option<f64> {
    let of = |s: &Sample| 0.5 * s.airspeed_mps.powi(2) + STANDARD_GRAVITY * s.altitude_m;
    let one = |w: &[Sample]| {
        let (first, second) = w.split_at(w.len() / 2);
        let time = w[w.len() - 1].time_s - w[0].time_s;
        let rate = (mean(second, of) - mean(first, of)) / (0.5 * time);
        (vec![mean(w, |s| s.airspeed_mps.powi(3)), mean(w, throttle)], rate)
    };
    correlation(windows(rows, ENERGY_S).into_iter().map(one))
}

/// The partial correlation over the finite ones of `equations`.
fn correlation(equations: impl Iterator<Item = (Vec<f64>, f64)>) -> Option<f64> {
    let finite = |(x, y): &(Vec<f64>, f64)| y.is_finite() && x.iter().all(|x| x.is_finite());
    partial_correlation(&equations.filter(finite).collect::<Vec<_>>())
}
