//! What is wrong with a table: wrong units, wrong signs, dead sensors, no flight.
//!
//! Units are told by what the columns must satisfy together: Euler angles are the integral of the
//! rates, a steady turn has V ψ̇ = g tan φ, an aircraft's specific force is near 1 g. A finding says
//! what it looks like; nothing is converted unasked.

use super::Sample;
use super::columns::COLUMNS;
use super::finding::Finding;
use super::phases::{self, Kind};
use crate::physics::atmosphere::STANDARD_GRAVITY;

const G: f64 = STANDARD_GRAVITY;
/// Rows below which nothing is said about units.
const ENOUGH: usize = 50;
const KMH: f64 = 3.6;
const KNOTS: f64 = 1.943_844;
const HELP: &str = "convert the column, or give its scale in a mapping (--mapping)";

/// Everything found in the rows as they stand in the file.
pub(super) fn check(rows: &[Sample]) -> Vec<Finding> {
    let mut out = Vec::new();
    if rows.is_empty() {
        out.push(Finding::problem("the log has no rows with all needed channels"));
        return out;
    }
    if rows.len() >= ENOUGH {
        out.extend(angles_and_rates(rows));
        out.extend(airspeed(rows));
        out.extend(specific_force(rows));
        out.extend(constant(rows));
    }
    if !phases::phases(rows).iter().any(|p| p.kind == Kind::Flight) {
        let fastest = values(rows, |s| s.airspeed_mps).into_iter().fold(0.0, f64::max);
        out.push(Finding::problem(format!(
            "there is no flight in this log: airspeed never stays above {} m/s for {} s (largest value {fastest:.1} m/s); give a log with a flight, or check the airspeed channel",
            phases::FLYING_MPS, phases::SUSTAINED_S
        )));
    }
    out
}

fn values(rows: &[Sample], get: impl Fn(&Sample) -> f64) -> Vec<f64> {
    rows.iter().map(get).filter(|x| x.is_finite()).collect()
}

/// The value below which the share `q` of the values lies.
fn quantile(mut values: Vec<f64>, q: f64) -> Option<f64> {
    if values.len() < ENOUGH {
        return None;
    }
    let at = (((values.len() - 1) as f64) * q) as usize;
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Regression through the origin of y on x: slope with correlation.
fn slope(pairs: &[(f64, f64)]) -> Option<(f64, f64)> {
    let sum = |f: fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>();
    let (xx, yy, xy) = (sum(|p| p.0 * p.0), sum(|p| p.1 * p.1), sum(|p| p.0 * p.1));
    (pairs.len() >= ENOUGH && xx > 0.0 && yy > 0.0).then(|| (xy / xx, xy / (xx * yy).sqrt()))
}

fn near(x: f64, target: f64, tolerance: f64) -> bool {
    (x / target - 1.0).abs() < tolerance
}

fn angles_and_rates(rows: &[Sample]) -> Vec<Finding> {
    let mut out = Vec::new();
    let degree = 1_f64.to_radians();
    // Roll over windows of half a second against the integral of p (q, r small: θ near level).
    let mut pairs = Vec::new();
    let (mut start, mut integral) = (0, 0.0);
    for i in 1..rows.len() {
        let step = rows[i].time_s - rows[i - 1].time_s;
        let p = 0.5 * (rows[i].rates_radps[0] + rows[i - 1].rates_radps[0]);
        if !(step > 0.0 && step < 0.5 && p.is_finite()) {
            (start, integral) = (i, 0.0);
            continue;
        }
        integral += p * step;
        if rows[i].time_s - rows[start].time_s >= 0.5 {
            let change = rows[i].attitude_rad[0] - rows[start].attitude_rad[0];
            if change.is_finite() {
                pairs.push((integral, change));
            }
            (start, integral) = (i, 0.0);
        }
    }
    let ratio = slope(&pairs).filter(|(_, correlation)| *correlation > 0.8).map(|(s, _)| s);
    let roll = quantile(values(rows, |s| s.attitude_rad[0].abs()), 0.99).unwrap_or(0.0);
    let pitch = quantile(values(rows, |s| s.attitude_rad[1].abs()), 0.99).unwrap_or(0.0);
    let rate = quantile(values(rows, |s| s.rates_radps[0].abs()), 0.99).unwrap_or(0.0);
    let large = roll > 3.3 || pitch > 1.7;
    let angles_in_degrees = large || ratio.is_some_and(|r| near(r, 1.0 / degree, 0.4));
    let rates_in_degrees = ratio.is_some_and(|r| near(r, degree, 0.4))
        || rate > 12.0
        || large && ratio.is_some_and(|r| near(r, 1.0, 0.4));
    if angles_in_degrees {
        out.push(Finding::problem(format!(
            "roll and pitch look like degrees, not radians (99 % of |roll| below {roll:.1}): {HELP} of 0.0174533"
        )));
    }
    if rates_in_degrees {
        out.push(Finding::problem(format!(
            "p, q, r look like degrees a second, not radians a second (99 % of |p| below {rate:.1}): {HELP} of 0.0174533"
        )));
    }
    if let Some(r) = ratio.filter(|_| !angles_in_degrees && !rates_in_degrees)
        && !near(r, 1.0, 0.4)
    {
        out.push(Finding::warning(format!(
            "roll changes {r:.2} times as much as p says: one of them is wrongly scaled or delayed"
        )));
    }
    if slope(&pairs).is_some_and(|(s, correlation)| s < 0.0 && correlation < -0.8) {
        out.push(Finding::problem(
            "roll falls while p is positive: one of them has the wrong sign (FRD: right wing down is positive)",
        ));
    }
    out
}

fn airspeed(rows: &[Sample]) -> Option<Finding> {
    // Steady turns tell V without wind; velocity over ground does if the wind is weak.
    let turning = rows.iter().filter_map(|s| {
        let [roll, pitch, _] = s.attitude_rad;
        let turn = (s.rates_radps[1] * roll.sin() + s.rates_radps[2] * roll.cos()) / pitch.cos();
        let banked = roll.abs() > 0.25 && roll.abs() < 1.2 && pitch.abs() < 0.5;
        let steady = s.rates_radps[0].abs() < 0.15 && turn.abs() > 0.05;
        (banked && steady && turn.is_finite()).then(|| s.airspeed_mps * turn / (G * roll.tan()))
    });
    let by_turns = quantile(turning.collect(), 0.5);
    let ground = rows.iter().filter_map(|s| {
        let [n, e, d] = s.velocity_ned_mps;
        let v = (n * n + e * e + d * d).sqrt();
        (v > 8.0).then_some(s.airspeed_mps / v)
    });
    let ground: Vec<f64> = ground.filter(|x| x.is_finite()).collect();
    let quarters = (quantile(ground.clone(), 0.25), quantile(ground.clone(), 0.75));
    let weak_wind = matches!(quarters, (Some(a), Some(b)) if b - a < 0.25 * b);
    let by_ground = quantile(ground, 0.5).filter(|_| weak_wind);
    verdict(by_turns, "turns").or_else(|| verdict(by_ground, "the velocity over ground"))
}

fn verdict(ratio: Option<f64>, by: &str) -> Option<Finding> {
    let ratio = ratio?;
    let (unit, factor) = if near(ratio, KMH, 0.2) {
        ("km/h", 1.0 / KMH)
    } else if near(ratio, KNOTS, 0.15) {
        ("knots", 1.0 / KNOTS)
    } else {
        return None;
    };
    Some(Finding::problem(format!(
        "airspeed looks like {unit}, not m/s (it is {ratio:.2} times what {by} show): {HELP} of {factor:.6}"
    )))
}

fn specific_force(rows: &[Sample]) -> Vec<Finding> {
    let mut out = Vec::new();
    let size = |s: &Sample| s.specific_force_mps2.iter().map(|a| a * a).sum::<f64>().sqrt();
    let Some(middle) = quantile(values(rows, size), 0.5) else { return out };
    let Some(z) = quantile(values(rows, |s| s.specific_force_mps2[2]), 0.5) else { return out };
    let mut unit = 1.0;
    if middle > 0.5 && middle < 2.0 {
        unit = 1.0 / G;
        out.push(Finding::problem(format!(
            "specific force looks like g, not m/s² (its median size is {middle:.2}): {HELP} of 9.80665"
        )));
    } else if middle > 300.0 && middle < 3000.0 {
        unit = 1000.0 / G;
        out.push(Finding::problem(format!(
            "specific force looks like milli-g, not m/s² (its median size is {middle:.0}): {HELP} of 0.00980665"
        )));
    }
    if z > 5.0 * unit {
        out.push(Finding::problem(format!(
            "az is {z:.2} in the middle: the z accelerometer looks positive up, while the log format's reads about -9.81 in level flight; {HELP} of -1"
        )));
    }
    out
}

fn constant(rows: &[Sample]) -> Vec<Finding> {
    let mut out = Vec::new();
    for (name, get, _) in &COLUMNS {
        let seen = values(rows, get);
        let Some(first) = seen.first() else { continue };
        let dead = seen.len() >= 2 * ENOUGH && seen.iter().all(|x| x == first);
        // Commands rest, rudders are often absent, targets hold.
        let may_rest = ["_cmd", "_target_rad", "rudder_rad", "air_density_kgpm3"]
            .iter()
            .any(|e| name.ends_with(e))
            || matches!(*name, "throttle" | "altitude_m");
        if dead && !may_rest {
            let text = format!(
                "{name} is constantly {first} over all {} rows: a sensor that is absent or dead",
                seen.len()
            );
            let needed = super::columns::NEEDED.contains(name);
            out.push(if needed { Finding::problem(text) } else { Finding::warning(text) });
        }
    }
    out
}
