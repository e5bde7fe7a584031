//! Checks whether north and east of the velocity over ground are exchanged, as in a log whose axes are east, north, up (ENU).
//!
//! The course then turns against the heading. In a right log it can do so only while the wind carries the aircraft backward, where
//! the exchanged velocity does not follow the heading.

use std::f64::consts::TAU;

use super::cured_by;
use super::force::turn_with_bank;
use super::relation::{change, through_origin, windows};
use crate::Sample;
use crate::finding::{Cure, Finding};

/// Time over which the changes of course and heading are compared, and least time between the rows that are used, s.
const WINDOW_S: f64 = 1.0;
const EVERY_S: f64 = 0.099;
/// Ground speed below which the course is not used, m/s.
const SLOWEST_MPS: f64 = 4.0;
/// Least change of heading in a window, and in all windows together, rad.
const TURN_RAD: f64 = 0.05;
const TURNS_RAD: f64 = 1.05;
/// Slope and correlation of the course with the heading below which the two turn against each other. In right logs of real and
/// simulated flights the slope was 0.8 to 1.03 and the correlation 0.9 and more.
const OPPOSITE: f64 = -0.5;
const CERTAIN: f64 = -0.8;
/// Correlation of the exchanged velocity with the direction of the heading above which it fits. In right logs the velocity as
/// logged had 0.94 and more.
const FITS: f64 = 0.9;

/// The finding that north and east of the velocity are exchanged. `rows` have right angles, rates and axes.
pub fn check(rows: &[Sample]) -> Option<Finding> {
    let known = thinned(rows);
    let turns = turns(&known);
    let turned: f64 = turns.iter().map(|(heading, _)| heading.abs()).sum();
    let relation = through_origin(turns.into_iter()).filter(|_| turned > TURNS_RAD)?;
    let opposite = relation.slope < OPPOSITE && relation.correlation < CERTAIN;
    let yaw_is_right = || turn_with_bank(rows).is_none_or(|r| r > 0.0);
    (opposite && fits_exchanged(&known) && yaw_is_right()).then(|| {
        let what = "vn_mps and ve_mps look exchanged: the course turns left in right turns";
        cured_by(what.into(), Cure::exchange("vn_mps", "ve_mps"))
    })
}

/// The rows that have a heading and a velocity over ground, thinned out.
fn thinned(rows: &[Sample]) -> Vec<Sample> {
    let mut last = f64::NEG_INFINITY;
    let mut keep = |s: &Sample| {
        let [north, east, _] = s.velocity_ned_mps;
        let known = (north + east + s.attitude_rad[2]).is_finite();
        let kept = known && s.time_s - last >= EVERY_S;
        if kept {
            last = s.time_s;
        }
        kept
    };
    rows.iter().filter(|s| keep(s)).copied().collect()
}

/// The changes of heading and course over the windows in turns, rad.
fn turns(rows: &[Sample]) -> Vec<(f64, f64)> {
    let fast = |s: &Sample| s.velocity_ned_mps[0].hypot(s.velocity_ned_mps[1]) > SLOWEST_MPS;
    let wrapped = |angle: f64| angle - TAU * (angle / TAU).round();
    let course = |s: &Sample| s.velocity_ned_mps[1].atan2(s.velocity_ned_mps[0]);
    windows(rows, WINDOW_S)
        .into_iter()
        .filter(|w| w.iter().all(fast))
        .map(|w| (wrapped(change(w, |s| s.attitude_rad[2])), wrapped(change(w, course))))
        .filter(|(heading, _)| heading.abs() > TURN_RAD)
        .collect()
}

/// Whether the velocity, with north and east exchanged, follows the direction of the heading apart from a steady wind.
fn fits_exchanged(rows: &[Sample]) -> bool {
    let of = |s: &Sample| {
        let (sin, cos) = s.attitude_rad[2].sin_cos();
        [cos, s.velocity_ned_mps[1], sin, s.velocity_ned_mps[0]]
    };
    let mean = |i: usize| rows.iter().map(|s| of(s)[i]).sum::<f64>() / rows.len() as f64;
    let means: [f64; 4] = std::array::from_fn(mean);
    let pairs = rows.iter().flat_map(|s| {
        let row = of(s);
        [(row[0] - means[0], row[1] - means[1]), (row[2] - means[2], row[3] - means[3])]
    });
    through_origin(pairs).is_some_and(|r| r.correlation > FITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 60 s at 17 m/s, with rows of the velocity at every fifth row only, in a wind from the south of `wind` m/s. The heading swings by
    /// ±`swing` rad about south, or circles if that is infinite.
    fn flown(wind: f64, swing: f64) -> Vec<Sample> {
        let one = |k: usize| {
            let time_s = 0.02 * k as f64;
            let yaw = match swing.is_finite() {
                true => std::f64::consts::PI + swing * (0.5 * time_s).sin(),
                false => 0.3 * time_s,
            };
            let velocity = [17.0 * yaw.cos() + wind, 17.0 * yaw.sin(), 0.0];
            Sample {
                time_s,
                attitude_rad: [0.0, 0.0, yaw],
                velocity_ned_mps: if k.is_multiple_of(5) { velocity } else { [f64::NAN; 3] },
                ..Sample::default()
            }
        };
        (0..3000).map(one).collect()
    }

    #[test]
    fn exchanged_velocities_are_found_in_any_wind_and_right_ones_are_not() {
        for wind in [0.0, 5.0, 10.0] {
            for swing in [0.8, f64::INFINITY] {
                let mut rows = flown(wind, swing);
                assert!(check(&rows).is_none(), "{wind} {swing}");
                rows.iter_mut().for_each(|s| s.velocity_ned_mps.swap(0, 1));
                let found = check(&rows).unwrap();
                for column in ["vn_mps", "ve_mps"] {
                    assert!(found.corrects(column), "{found}");
                }
                let lines = r#"vn_mps = { from = "csv.ve_mps", scale = 1 } and ve_mps = { from = "csv.vn_mps", scale = 1 }"#;
                assert!(found.text.contains(lines), "{found}");
            }
        }
    }

    #[test]
    fn a_flight_that_the_wind_carries_backward_is_right() {
        let rows = flown(30.0, 0.5);
        let course = through_origin(turns(&thinned(&rows)).into_iter()).unwrap();
        assert!(course.slope < OPPOSITE && course.correlation < CERTAIN, "{course:?}");
        assert!(check(&rows).is_none());
    }
}
