//! Checks of a log for wrong units and signs of airspeed, vanes (angle of attack and sideslip), altitude and air density.

use super::cured;
use super::relation::{
    Relation, change, integral, near, quantile, through_origin, values, windows, with_intercept,
};
use crate::Sample;
use crate::finding::Finding;
use greylag_physics::atmosphere::{STANDARD_GRAVITY, standard_density};

/// Units of speed other than m/s: name, and size in m/s.
const SPEEDS: [(&str, f64); 3] = [("km/h", 1.0 / 3.6), ("knots", 0.514_444), ("ft/s", 0.3048)];
/// Metres in a foot.
const FOOT: f64 = 0.3048;
/// Length of the windows over which the change of altitude is compared with the integral of the climb rate, s.
const CLIMB_S: f64 = 2.0;
/// Largest interquartile range, relative to the median, of the ratios of airspeed to ground speed. If it is larger, wind affects
/// the ratios and they are not used.
const GROUND_SPREAD: f64 = 0.25;
/// The same limit for the ratios of airspeed to the airspeed computed from turns, which manoeuvres spread.
const TURN_SPREAD: f64 = 0.5;
/// Magnitude of the correlation above which a regression is used.
const CERTAIN: f64 = 0.8;
/// The column of a vane is in degrees if more than 5 % of its values exceed this, rad.
const VANE_LARGE: f64 = 1.0;

/// Makes the checks of this module on `rows`. The vanes turn freely on the ground, so they are checked only in `flown`, the rows
/// in flight.
pub fn check(rows: &[Sample], flown: &[Sample]) -> Vec<Finding> {
    let airspeed = airspeed(rows);
    let speed_is_right = airspeed.is_none();
    let mut out: Vec<Finding> = airspeed.into_iter().collect();
    out.extend(vanes(flown));
    out.extend(climb(rows, speed_is_right));
    out
}

/// Checks the unit of the airspeed. A steady turn gives the airspeed V = g tan φ / ψ̇, whatever the wind. The velocity over
/// ground is compared with it only if the wind is weak.
fn airspeed(rows: &[Sample]) -> Option<Finding> {
    let by_turns = steady(&values(rows, by_turn), TURN_SPREAD);
    let ground = values(rows, |s| {
        let v = s.velocity_ned_mps.iter().map(|v| v * v).sum::<f64>().sqrt();
        if v > 8.0 { s.airspeed_mps / v } else { f64::NAN }
    });
    other_unit(by_turns, "turns show")
        .or_else(|| other_unit(steady(&ground, GROUND_SPREAD), "the velocity over ground shows"))
}

/// The median of `ratios`; `None` if their interquartile range reaches `spread` times the median.
fn steady(ratios: &[f64], spread: f64) -> Option<f64> {
    let [low, middle, high] = [0.25, 0.5, 0.75].map(|q| quantile(ratios, q));
    middle.filter(|m| high.zip(low).is_some_and(|(high, low)| high - low < spread * m))
}

/// Ratio of the logged airspeed to the airspeed computed from a steady turn; NaN outside of turns.
fn by_turn(s: &Sample) -> f64 {
    let [roll, pitch, _] = s.attitude_rad;
    let turn = (s.rates_radps[1] * roll.sin() + s.rates_radps[2] * roll.cos()) / pitch.cos();
    let banked = roll.abs() > 0.25 && roll.abs() < 1.2 && pitch.abs() < 0.5;
    let steady = s.rates_radps[0].abs() < 0.15 && turn.abs() > 0.05;
    if banked && steady {
        s.airspeed_mps * turn / (STANDARD_GRAVITY * roll.tan())
    } else {
        f64::NAN
    }
}

fn other_unit(ratio: Option<f64>, shown: &str) -> Option<Finding> {
    let ratio = ratio?;
    let miss = |mps: f64| (ratio * mps - 1.0).abs();
    let (unit, scale) = SPEEDS.into_iter().min_by(|a, b| miss(a.1).total_cmp(&miss(b.1)))?;
    if miss(scale) > 0.15 {
        return None;
    }
    Some(cured(
        format!("airspeed looks like {unit}, not m/s (it is {ratio:.2} times what {shown})"),
        "airspeed_mps",
        (scale * 1e6).round() / 1e6,
    ))
}

fn vanes(rows: &[Sample]) -> Vec<Finding> {
    let large = |get: fn(&Sample) -> f64| quantile(&values(rows, |s| get(s).abs()), 0.95);
    [("alpha_rad", large(|s| s.alpha_rad)), ("beta_rad", large(|s| s.beta_rad))]
        .into_iter()
        .filter_map(|(column, size)| Some((column, size.filter(|x| *x > VANE_LARGE)?)))
        .map(|(column, size)| {
            cured(
                format!("{column} looks like degrees, not radians (95 % of it below {size:.1})"),
                column,
                0.0174533,
            )
        })
        .collect()
}

/// Compares the change of altitude with the integral of the climb rate. The climb rate comes from the velocity over ground, and
/// from airspeed, pitch and angle of attack. If there is no finding, the air density is checked. `speed_is_right` states whether
/// the check of the airspeed found nothing.
fn climb(rows: &[Sample], speed_is_right: bool) -> Option<Finding> {
    let windows = windows(rows, CLIMB_S);
    let height = |w: &&[Sample]| change(w, |s| s.altitude_m);
    let down = through_origin(
        windows.iter().map(|w| (-integral(w, |s| s.velocity_ned_mps[2]), height(w))),
    );
    let pitch = |s: &Sample| {
        let alpha = if s.alpha_rad.abs() < VANE_LARGE { s.alpha_rad } else { 0.0 };
        s.airspeed_mps * (s.attitude_rad[1] - alpha).sin()
    };
    let air = with_intercept(windows.iter().map(|w| (integral(w, pitch), height(w))));
    let sure = |r: Option<Relation>| r.filter(|r| r.correlation.abs() > CERTAIN).map(|r| r.slope);
    let (down, air) = (sure(down), sure(air));
    let feet = |slope: Option<f64>| slope.is_some_and(|s| near(s, 1.0 / FOOT, 0.3));
    if feet(air) && speed_is_right || feet(down) && air.is_none() {
        return Some(cured(
            format!(
                "altitude looks like feet, not metres (it climbs {:.1} times as fast as the aircraft)",
                air.or(down).unwrap_or_default()
            ),
            "altitude_m",
            FOOT,
        ));
    }
    if speed_is_right && air.is_some_and(|s| near(s, FOOT, 0.3)) {
        return Some(cured("airspeed looks like ft/s, not m/s (the altitude climbs 0.3 times as fast as airspeed and pitch say)".into(), "airspeed_mps", FOOT));
    }
    if air.is_some_and(|s| s < 0.0) && down.is_none_or(|s| s < 0.0) {
        return Some(cured("altitude falls while the nose is up and the aircraft flies: it looks positive down, while the log format's is positive up".into(), "altitude_m", -1.0));
    }
    if down.is_some_and(|s| s < 0.0) {
        return Some(cured("altitude rises while vd_mps is positive: the velocity looks positive up (ENU), while the log format's is positive down (NED)".into(), "vd_mps", -1.0));
    }
    density(rows)
}

/// Compares the logged air density with that of the standard atmosphere at the logged altitude.
fn density(rows: &[Sample]) -> Option<Finding> {
    let ratio = |foot: f64| {
        quantile(
            &values(rows, |s| s.air_density_kgpm3 / standard_density(s.altitude_m * foot)),
            0.5,
        )
    };
    let metres = ratio(1.0).filter(|r| !(0.75..1.3).contains(r))?;
    Some(if ratio(FOOT).is_some_and(|r| near(r, 1.0, 0.12)) {
        let text = "altitude looks like feet, not metres (the logged air density fits it so)";
        cured(text.into(), "altitude_m", FOOT)
    } else {
        Finding::problem(format!(
            "the logged air density is {metres:.2} times that of the standard atmosphere at the logged altitude: one of air_density_kgpm3 and altitude_m is in another unit; map it, or leave the density out"
        ))
    })
}
