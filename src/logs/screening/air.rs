//! Checks of a log for wrong units and signs of airspeed, vanes (angle of attack and sideslip), altitude and air density.

use nalgebra::{Rotation3, Vector3};

use super::force::air_velocity;
use super::held::held;
use super::relation::{
    Relation, change, integral, near, quantile, through_origin, values, windows, with_intercept,
};
use super::{cured, cured_by, undecided};
use crate::Sample;
use crate::finding::{Cure, Finding};
use greylag_physics::atmosphere::{STANDARD_GRAVITY, standard_density};

/// Units of speed other than m/s: name, and size in m/s.
const SPEEDS: [(&str, f64); 4] =
    [("knots", 0.514_444), ("mph", 0.447_04), ("ft/s", 0.3048), ("km/h", 1.0 / 3.6)];
/// Largest relative error of the ratio of airspeeds that turns, the size of the velocity over ground or the climb show: wind and
/// manoeuvres change it. A unit within [`FOUND`] shows that the unit is wrong, and every unit within `ROUGH` may be the one.
const FOUND: f64 = 0.15;
const ROUGH: f64 = 0.2;
/// Largest relative error of the ratio of [`by_wind`]. In right logs of simulated flights it was below 0.05.
const SHARP: f64 = 0.07;
/// Correlation above which the ratio of [`by_wind`] is used, the least standard deviation of the velocity relative to the air,
/// relative to its size, and about how many rows are taken from a long log.
const CLOSE: f64 = 0.98;
const TURNS: f64 = 0.1;
const MOST: usize = 10_000;
/// Largest relative difference of the altitude's rate of climb from the one that airspeed and pitch give in the same unit.
const CLIMB: f64 = 0.3;
/// Metres in a foot.
const FOOT: f64 = 0.3048;
/// Length of the windows over which the change of altitude is compared with the integral of the climb rate, s.
const CLIMB_S: f64 = 2.0;
/// Columns of the check of the altitude, which a flight controller may log at different times, and least time between its rows, s.
const OF_CLIMB: [&str; 5] = ["pitch_rad", "airspeed_mps", "alpha_rad", "vd_mps", "altitude_m"];
const CLIMB_EVERY_S: f64 = 0.099;
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

/// Checks the unit of the airspeed. Changes of the velocity over ground show it in a steady wind. A steady turn gives the airspeed
/// V = g tan φ / ψ̇, whatever the wind. The size of the velocity over ground is compared with it only if the wind is weak.
fn airspeed(rows: &[Sample]) -> Option<Finding> {
    let shown = "the velocity over ground shows";
    let why = |ratio: f64, shown: &str| format!("it is {ratio:.2} times what {shown}");
    let in_wind = by_wind(rows);
    if let Some(ratio) = in_wind.filter(|ratio| !units(*ratio, SHARP).is_empty()) {
        return other_unit(&units(ratio, SHARP), &why(ratio, shown));
    }
    let rough = |ratio: Option<f64>, shown: &str| {
        let ratio = ratio.filter(|ratio| !units(*ratio, FOUND).is_empty())?;
        other_unit(&units(ratio, ROUGH), &why(ratio, shown))
    };
    let by_turns = steady(&values(rows, by_turn), TURN_SPREAD);
    let ground = values(rows, |s| {
        let v = s.velocity_ned_mps.iter().map(|v| v * v).sum::<f64>().sqrt();
        if v > 8.0 { s.airspeed_mps / v } else { f64::NAN }
    });
    rough(by_turns, "turns show")
        .or_else(|| rough(in_wind.or_else(|| steady(&ground, GROUND_SPREAD)), shown))
}

/// Ratio of the logged airspeed to the one that the velocity over ground shows: the slope of a regression in which a steady wind is
/// the intercept. `None` if the flight does not show it, for instance on a straight course.
fn by_wind(rows: &[Sample]) -> Option<f64> {
    let of = |s: &Sample| {
        let [roll, pitch, yaw] = s.attitude_rad;
        let to_earth = Rotation3::from_euler_angles(roll, pitch, yaw);
        let air = to_earth * Vector3::from(air_velocity(s));
        [air.x, s.velocity_ned_mps[0], air.y, s.velocity_ned_mps[1]]
    };
    let finite = rows.iter().map(of).filter(|row| row.iter().all(|x| x.is_finite()));
    let all: Vec<[f64; 4]> = finite.step_by(rows.len() / MOST + 1).collect();
    let mean = |i: usize| all.iter().map(|row| row[i]).sum::<f64>() / all.len() as f64;
    let means: [f64; 4] = std::array::from_fn(mean);
    let square = |x: f64, y: f64| x * x + y * y;
    let size: f64 = all.iter().map(|row| square(row[0], row[2])).sum();
    let moved: f64 = all.iter().map(|row| square(row[0] - means[0], row[2] - means[2])).sum();
    if moved < TURNS * TURNS * size {
        return None;
    }
    let pairs = all.iter().flat_map(|row| {
        [(row[0] - means[0], row[1] - means[1]), (row[2] - means[2], row[3] - means[3])]
    });
    through_origin(pairs).filter(|r| r.correlation > CLOSE).map(|r| 1.0 / r.slope)
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

/// The units of speed in which the airspeed may be logged if it is `ratio` times the right one with a relative error of at most
/// `error`.
fn units(ratio: f64, error: f64) -> Vec<(&'static str, f64)> {
    SPEEDS.into_iter().filter(|(_, mps)| (ratio * mps - 1.0).abs() <= error).collect()
}

/// The finding that the airspeed is in one of `units`, for the reason `why`. Only a single unit is corrected.
fn other_unit(units: &[(&'static str, f64)], why: &str) -> Option<Finding> {
    let cure = |mps: f64| Cure::factor("airspeed_mps", (mps * 1e6).round() / 1e6);
    let names: Vec<&str> = units.iter().map(|(name, _)| *name).collect();
    let what = format!("airspeed looks like {}, not m/s ({why})", names.join(" or "));
    match units {
        [] => None,
        [(_, mps)] => Some(cured_by(what, cure(*mps))),
        _ => {
            let choices = units.iter().map(|(name, mps)| (*name, cure(*mps))).collect();
            Some(undecided(&what, choices))
        }
    }
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
    let together = held(rows, &OF_CLIMB, CLIMB_EVERY_S);
    let windows = windows(&together, CLIMB_S);
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
    let feet = |slope: Option<f64>| slope.is_some_and(|s| near(s, 1.0 / FOOT, CLIMB));
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
    if let Some(slope) = air.filter(|s| speed_is_right && near(*s, FOOT, CLIMB)) {
        let why = format!("the altitude climbs {slope:.2} times as fast as airspeed and pitch say");
        let units: Vec<_> =
            SPEEDS.into_iter().filter(|(_, mps)| near(slope, *mps, CLIMB)).collect();
        return other_unit(&units, &why);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// 40 s of level flight at 17 m/s in a wind of 3 m/s, on a course that swings by ±`swing` rad. The airspeed is logged times
    /// `factor`.
    fn flown(swing: f64, factor: f64) -> Vec<Sample> {
        let one = |k: usize| {
            let time_s = 0.1 * k as f64;
            let yaw = swing * (0.4 * time_s).sin();
            Sample {
                time_s,
                attitude_rad: [0.0, 0.0, yaw],
                rates_radps: [0.0, 0.0, 0.4 * swing * (0.4 * time_s).cos()],
                airspeed_mps: 17.0 * factor,
                velocity_ned_mps: [17.0 * yaw.cos() + 3.0, 17.0 * yaw.sin(), 0.0],
                ..Sample::default()
            }
        };
        (0..400).map(one).collect()
    }

    #[test]
    fn a_flight_that_turns_shows_the_unit_of_the_airspeed_in_wind() {
        for (unit, mps) in SPEEDS {
            let found = airspeed(&flown(0.8, 1.0 / mps)).unwrap();
            assert!(found.text.contains(&format!("looks like {unit}, not")), "{}", found.text);
            let scale = found.cure.unwrap().scale;
            assert!(near(scale, mps, 1e-5), "{unit} {scale}");
        }
        assert!(airspeed(&flown(0.8, 1.0)).is_none());
    }

    #[test]
    fn a_straight_flight_leaves_two_units_open() {
        // the wind makes 3.6 times the airspeed 3.06 times the velocity over ground
        let found = airspeed(&flown(0.01, 3.6)).unwrap();
        assert!(found.text.contains("ft/s or km/h, not m/s (it is 3.06 times"), "{}", found.text);
        assert!(found.cure.is_none());
        let scales: Vec<f64> = found.choices.iter().map(|cure| cure.scale).collect();
        assert_eq!(scales, [0.3048, 0.277778]);
        for line in ["scale = 0.3048 } for ft/s", "scale = 0.277778 } for km/h"] {
            assert!(found.text.contains(line), "{}", found.text);
        }
    }
}
