//! Estimates by how much the recorded velocity and airspeed lag behind the inertial sensors, by cross-correlation.
//!
//! The rate of change of the ground velocity equals the specific force in earth axes plus gravity. The rate of change
//! of the airspeed is about the acceleration along the body x axis. The delay is the time shift with the highest
//! correlation between the two sides. A delay that matters becomes a finding, a message to the user.

use nalgebra::{Rotation3, Vector3};

use super::Sample;
use super::finding::Finding;
use greylag_num::statistics::mean;
use greylag_physics::atmosphere::STANDARD_GRAVITY;

/// Sample period of the compared series, and step of the shifts, s.
const STEP_S: f64 = 0.05;
/// Largest shift that is tried, s.
const SHIFT_S: f64 = 3.0;
/// Time span over which changes of velocity and airspeed are computed, s.
const OVER_S: f64 = 0.6;
/// Shortest stretch of a log that is evaluated, s.
const SHORTEST_S: f64 = 12.0;
/// Longest stretch of a log that is evaluated, s. A longer one adds no accuracy.
const LONGEST_S: f64 = 300.0;
/// A delay counts as certain if its correlation exceeds `CERTAIN` and exceeds the correlation without a shift by `BETTER`.
const CERTAIN: f64 = 0.7;
const BETTER: f64 = 0.15;
/// Smallest delay that is reported, s.
const NAMED_S: f64 = 0.25;
/// Smallest delay that is reported as a problem, because results from the log would be wrong, s.
const WRONG_S: f64 = 0.6;

/// Returns a finding for each delay that is large enough to be reported.
pub(super) fn check(rows: &[Sample]) -> Vec<Finding> {
    let Some(grid) = Grid::of(rows) else { return Vec::new() };
    let forces: Vec<Vector3<f64>> = grid.forces();
    let along: Vec<f64> = grid.along();
    let earth = |axis: usize| forces.iter().map(|f| f[axis]).collect::<Vec<f64>>();
    let velocity = |axis: usize| grid.series(|s| s.velocity_ned_mps[axis]);
    let pairs: Vec<_> = (0..3).filter_map(|axis| Some((velocity(axis)?, earth(axis)))).collect();
    let airspeed = grid.series(|s| s.airspeed_mps).map(|v| (v, along));
    let all = [
        ("velocity over ground", "skew_velocity_s", pairs),
        ("airspeed", "skew_airspeed_s", airspeed.into_iter().collect()),
    ];
    all.into_iter().filter_map(|(what, key, pairs)| said(what, key, delay(&pairs)?)).collect()
}

fn said(what: &str, key: &str, delay_s: f64) -> Option<Finding> {
    let word = if delay_s > 0.0 { "late" } else { "early" };
    let text = format!(
        "the {what} is {:.1} s {word} against the accelerometers: shift its times before the log is used \
         ({key} takes up at most a sample period)",
        delay_s.abs()
    );
    match delay_s.abs() {
        d if d >= WRONG_S => Some(Finding::problem(text)),
        d if d >= NAMED_S => Some(Finding::warning(text)),
        _ => None,
    }
}

/// The longest stretch without gaps in the first 15 min of a log, and evenly spaced times for its resampling.
struct Grid<'a> {
    rows: Vec<&'a Sample>,
    times: Vec<f64>,
}

impl<'a> Grid<'a> {
    fn of(rows: &'a [Sample]) -> Option<Grid<'a>> {
        let complete = |s: &&Sample| {
            s.specific_force_mps2.iter().chain(&s.attitude_rad).all(|x| x.is_finite())
        };
        let until = rows.first()?.time_s + 3.0 * LONGEST_S;
        let looked_at = rows.iter().take_while(|s| s.time_s < until);
        let rows: Vec<&Sample> = looked_at.filter(complete).collect();
        let mut best = 0..0;
        let mut start = 0;
        for i in 1..=rows.len() {
            let goes_on = i < rows.len() && rows[i].time_s - rows[i - 1].time_s < 3.0 * STEP_S;
            if !goes_on {
                let length = |a: usize, b: usize| rows[b - 1].time_s - rows[a].time_s;
                if best.is_empty() || length(start, i) > length(best.start, best.end) {
                    best = start..i;
                }
                start = i;
            }
        }
        let (first, last) =
            (rows.get(best.start)?.time_s, rows.get(best.end.checked_sub(1)?)?.time_s);
        let length = (last - first).min(LONGEST_S);
        let count = (length / STEP_S) as usize;
        let times = (0..count).map(|k| first + k as f64 * STEP_S).collect();
        (length >= SHORTEST_S).then(|| Grid { rows: rows[best].to_vec(), times })
    }

    /// A column, resampled to the even times; `None` if it has fewer than two values per second.
    fn series(&self, get: impl Fn(&Sample) -> f64) -> Option<Vec<f64>> {
        self.at_even_times(self.rows.iter().copied().map(get))
    }

    /// The `values` of the rows, resampled to the even times; `None` if there are fewer than two values per second.
    fn at_even_times(&self, values: impl Iterator<Item = f64>) -> Option<Vec<f64>> {
        let pairs = self.rows.iter().map(|s| s.time_s).zip(values);
        let own: Vec<(f64, f64)> = pairs.filter(|(_, x)| x.is_finite()).collect();
        let rate = own.len() as f64 / (self.times.len() as f64 * STEP_S);
        if rate < 2.0 {
            return None;
        }
        let at = |t: &f64| {
            let after = own.partition_point(|(time, _)| time < t).clamp(1, own.len() - 1);
            let (a, b) = (own[after - 1], own[after]);
            a.1 + (b.1 - a.1) * ((t - a.0) / (b.0 - a.0)).clamp(0.0, 1.0)
        };
        Some(self.times.iter().map(at).collect())
    }

    /// Acceleration in earth axes at the even times, m/s².
    fn forces(&self) -> Vec<Vector3<f64>> {
        let all: Vec<Vector3<f64>> = self.rows.iter().copied().map(earth).collect();
        let axis = |k: usize| self.at_even_times(all.iter().map(|f| f[k])).unwrap_or_default();
        let [n, e, d] = [axis(0), axis(1), axis(2)];
        n.iter().zip(&e).zip(&d).map(|((n, e), d)| Vector3::new(*n, *e, *d)).collect()
    }

    /// Acceleration along the body x axis at the even times, m/s²: specific force plus gravity.
    fn along(&self) -> Vec<f64> {
        let along =
            |s: &Sample| s.specific_force_mps2[0] - STANDARD_GRAVITY * s.attitude_rad[1].sin();
        self.series(along).unwrap_or_default()
    }
}

/// Acceleration in earth axes (NED), m/s²: specific force plus gravity.
fn earth(s: &Sample) -> Vector3<f64> {
    let [roll, pitch, yaw] = s.attitude_rad;
    Rotation3::from_euler_angles(roll, pitch, yaw) * Vector3::from(s.specific_force_mps2)
        + Vector3::new(0.0, 0.0, STANDARD_GRAVITY)
}

/// The common delay of the first series of all pairs, s. Each pair is a velocity and the acceleration that belongs to it. At
/// the delay, the changes of the velocities correlate best with the integrals of the accelerations. `None` if no delay is
/// certain.
fn delay(pairs: &[(Vec<f64>, Vec<f64>)]) -> Option<f64> {
    let over = (OVER_S / STEP_S) as usize;
    let (mut changes, mut expected): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    for (v, a) in pairs.iter().filter(|(v, a)| v.len() == a.len() && v.len() > 4 * over) {
        changes.push(centred(v.iter().zip(&v[over..]).map(|(from, to)| to - from).collect()));
        expected.push(centred(a.windows(over).map(|w| w.iter().sum::<f64>() * STEP_S).collect()));
    }
    let correlation = |shift: isize| {
        let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
        for (v, a) in changes.iter().zip(&expected) {
            for (i, y) in v.iter().enumerate() {
                let Some(x) = i.checked_add_signed(-shift).and_then(|j| a.get(j)) else { continue };
                (xx, yy, xy) = (xx + x * x, yy + y * y, xy + x * y);
            }
        }
        if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
    };
    let most = (SHIFT_S / STEP_S) as isize;
    let best = (-most..=most).max_by(|a, b| correlation(*a).total_cmp(&correlation(*b)))?;
    let (found, unshifted) = (correlation(best), correlation(0));
    let inside = best.abs() < most;
    (inside && found > CERTAIN && found > unshifted + BETTER).then_some(best as f64 * STEP_S)
}

fn centred(values: Vec<f64>) -> Vec<f64> {
    let middle = mean(&values);
    values.into_iter().map(|x| x - middle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Level flight to the north with an oscillating speed. The recorded velocity over ground is delayed by `late` s.
    fn rows(late: f64) -> Vec<Sample> {
        let speed = |t: f64| 15.0 + (0.9 * t).sin() + 0.7 * (2.3 * t + 1.0).sin();
        let force = |t: f64| 0.9 * (0.9 * t).cos() + 0.7 * 2.3 * (2.3 * t + 1.0).cos();
        (0..3000)
            .map(|i| {
                let t = 0.01 * f64::from(i);
                Sample {
                    time_s: t,
                    attitude_rad: [0.0; 3],
                    specific_force_mps2: [force(t), 0.0, -STANDARD_GRAVITY],
                    velocity_ned_mps: [speed(t - late), 0.0, 0.0],
                    airspeed_mps: speed(t),
                    ..Sample::default()
                }
            })
            .collect()
    }

    #[test]
    fn a_late_velocity_is_named_with_its_delay_and_a_punctual_one_is_not() {
        assert_eq!(check(&rows(0.0)), []);
        let [found] = &check(&rows(1.5))[..] else { panic!() };
        assert!(found.text.contains("velocity over ground is 1.5 s late"), "{}", found.text);
    }
}
