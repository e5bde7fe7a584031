//! Resamples recorded signals at the times of the table's rows: a value is interpolated or held, and angles are unwrapped.

use std::borrow::Cow;
use std::cell::Cell;
use std::f64::consts::{PI, TAU};

use super::Sample;
use super::columns::{COLUMNS, Place, index, is_held, is_wrapped};
use super::mapping::rule::{Fill, Rule};

/// Two times count as equal if they differ by at most this, s. Logs count in microseconds or milliseconds.
pub(super) const SAME_S: f64 = 1e-6;

/// The samples of a signal, prepared for reading at any time.
pub(super) struct Reader<'a> {
    times: &'a [f64],
    series: Cow<'a, [Vec<f64>]>,
    /// Longest time for which a value is held, and longest time between two samples that are interpolated, s.
    limit: f64,
    to: Target,
    /// Index in `times` at which the search for the next row begins.
    last: Cell<usize>,
}

/// The columns that a signal fills.
enum Target {
    Attitude,
    Column { place: Place, held: bool, wraps: bool },
}

impl<'a> Reader<'a> {
    /// Prepares the samples of the signal that `rule` describes. `limit` is the longest time (s) for which a value is held or
    /// interpolated.
    pub(super) fn new(
        rule: &Rule,
        times: &'a [f64],
        series: &'a [Vec<f64>],
        limit: f64,
    ) -> Option<Reader<'a>> {
        let mut series = Cow::Borrowed(series);
        let to = match &rule.fill {
            Fill::Quaternion { .. } => {
                one_sided(series.to_mut());
                Target::Attitude
            }
            Fill::Sum { .. } | Fill::Tilt { .. } | Fill::Density { .. } => {
                let column = rule.columns()[0];
                let wraps = is_wrapped(column) && is_angle(&series[0], column);
                if wraps {
                    unwrap(&mut series.to_mut()[0], largest(column));
                }
                let place = COLUMNS[index(column)?].2;
                Target::Column { place, held: is_held(column), wraps }
            }
        };
        Some(Reader { times, series, limit, to, last: Cell::new(0) })
    }

    /// Fills the columns of `row` with the values at the row's time.
    pub(super) fn put(&self, row: &mut Sample) {
        let (times, limit) = (self.times, self.limit);
        let at = At::near(row.time_s, times, self.last.get());
        self.last.set(at.after);
        match &self.to {
            Target::Attitude => {
                let q = [0, 1, 2, 3].map(|k| at.between(&self.series[k], times, limit));
                if let Some(attitude) = euler(q) {
                    row.attitude_rad = attitude;
                }
            }
            Target::Column { place, held, wraps } => {
                let value = match held {
                    true => at.held(&self.series[0], times, limit),
                    false => at.between(&self.series[0], times, limit),
                };
                *place(row) = if *wraps { wrap(value) } else { value };
            }
        }
    }
}

/// Changes the signs of quaternions so that successive ones have a positive dot product. q and −q are the same
/// attitude.
fn one_sided(q: &mut [Vec<f64>]) {
    for i in 1..q[0].len() {
        let dot: f64 = q.iter().map(|s| s[i] * s[i - 1]).sum();
        if dot < 0.0 {
            q.iter_mut().for_each(|s| s[i] = -s[i]);
        }
    }
}

/// Roll, pitch and yaw (rad) of a quaternion, w first. `None` if its norm is not between 0.5 and 2.
fn euler([w, x, y, z]: [f64; 4]) -> Option<[f64; 3]> {
    let n = (w * w + x * x + y * y + z * z).sqrt();
    if !(n > 0.5 && n < 2.0) {
        return None;
    }
    let [w, x, y, z] = [w / n, x / n, y / n, z / n];
    Some([
        (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
        (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
        (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)),
    ])
}

/// Number of samples that are searched one by one before a binary search.
const STEPS: usize = 8;

/// Position of a time among a channel's times.
#[derive(Clone, Copy)]
struct At {
    t: f64,
    /// The first sample later than `t`.
    after: usize,
}

impl At {
    /// Finds `t` among `times`. The search begins at the index `place`, because successive rows usually have increasing times.
    fn near(t: f64, times: &[f64], place: usize) -> At {
        let passed = |x: &f64| *x <= t + SAME_S;
        let ahead = times.get(place..).unwrap_or_default();
        let follows = place == 0 || times.get(place - 1).is_some_and(passed);
        let step = ahead.iter().take(STEPS).position(|x| !passed(x)).filter(|_| follows);
        At { t, after: step.map_or_else(|| times.partition_point(passed), |k| place + k) }
    }

    fn held(self, values: &[f64], times: &[f64], limit: f64) -> f64 {
        match self.after.checked_sub(1) {
            Some(i) if self.t - times[i] <= limit => values[i],
            _ => f64::NAN,
        }
    }

    fn between(self, values: &[f64], times: &[f64], limit: f64) -> f64 {
        let Some(i) = self.after.checked_sub(1) else { return f64::NAN };
        let past = self.t - times[i];
        if past.abs() <= SAME_S {
            return values[i];
        }
        match times.get(self.after) {
            Some(next) if next - times[i] <= limit => {
                values[i] + (values[self.after] - values[i]) * past / (next - times[i])
            }
            _ => f64::NAN,
        }
    }
}

/// Largest magnitude of an undamaged angle, rad: 2π for the yaw angle, π for others, with a tolerance for rounding.
fn largest(column: &str) -> f64 {
    (if column == "yaw_rad" { TAU } else { PI }) + 1e-3
}

/// Largest fraction of values beyond this magnitude in a column that is still taken as an angle in radians.
const DAMAGED: f64 = 0.01;

/// Whether the values of a series can be angles in radians. If a series in degrees were wrapped, its wrong unit would be hidden.
fn is_angle(series: &[f64], column: &str) -> bool {
    let limit = largest(column);
    let beyond = series.iter().filter(|x| !is_within(**x, limit)).count();
    beyond as f64 <= DAMAGED * series.len() as f64
}

fn is_within(angle: f64, limit: f64) -> bool {
    angle.abs() <= limit
}

/// Removes the jumps of 2π from `angles`. An angle of larger magnitude than `limit` is damaged and becomes NaN.
fn unwrap(angles: &mut [f64], limit: f64) {
    let mut last: Option<f64> = None;
    for angle in angles {
        if !is_within(*angle, limit) {
            *angle = f64::NAN;
            continue;
        }
        if let Some(last) = last {
            *angle -= ((*angle - last) / TAU).round() * TAU;
        }
        last = Some(*angle);
    }
}

/// Brings an interpolated angle back to −π..π.
fn wrap(angle: f64) -> f64 {
    angle - (angle / TAU).round() * TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_damaged_angle_does_not_end_the_unwrapping_of_the_others() {
        // a slow turn through ±π
        let turn: Vec<f64> = (0..400).map(|k| wrap(0.02 * f64::from(k))).collect();
        let mut damaged = turn.clone();
        damaged[200] = 1e30;
        assert!(is_angle(&damaged, "roll_rad"));
        unwrap(&mut damaged, largest("roll_rad"));
        for (k, x) in damaged.iter().enumerate() {
            let off = (x - 0.02 * k as f64).abs();
            assert!(if k == 200 { x.is_nan() } else { off < 1e-9 }, "{k} {x}");
        }
        // a bank of 20° for a fiftieth of the time, in degrees
        let mut degrees = vec![1.0; 400];
        degrees[..8].fill(20.0);
        assert!(!is_angle(&degrees, "roll_rad"));
    }
}
