//! One channel (column) of a log: its finite samples in time order, and their interpolation.

use std::ops::{Add, Mul, Sub};
use std::sync::Arc;

use greylag_num::statistics::quantile;

/// Fraction of repeated values above which the sensor is assumed to be slower than the rows of the log.
const HELD_SHARE: f64 = 0.3;
/// Number of periods of a slow sensor after which a repeated value counts as a new measurement.
const LONGEST_PERIODS: f64 = 2.5;

/// Kind of a channel's values. It determines the interpolation and the treatment of repeated values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// A real number, interpolated linearly.
    Linear,
    /// An angle that wraps at ±π, rad.
    Angle,
    /// A command, a position or another quantity whose repeated values are all kept. It is interpolated linearly or held.
    Kept,
}

/// Finite samples of a channel.
#[derive(Clone, Debug)]
pub struct Channel {
    time: Arc<Vec<f64>>,
    value: Vec<f64>,
    /// Whether the channel has more than 20 values and all of them are equal. Always false for `Interpolation::Kept`.
    pub stuck: bool,
}

impl Channel {
    /// A channel with the finite values among `samples` (time in s, value). Angles are unwrapped.
    ///
    /// If many values repeat the previous value, the sensor is slower than the rows of the log, and repeated values are dropped.
    /// If a value persists for several periods of the sensor, for example because of coarse quantisation, some of its repetitions
    /// are kept. The last sample is always kept.
    pub fn new(samples: impl Iterator<Item = (f64, f64)>, kind: Interpolation) -> Channel {
        let (mut time, mut value): (Vec<f64>, Vec<f64>) =
            samples.filter(|(_, x)| x.is_finite()).unzip();
        let fresh: Vec<bool> =
            (0..value.len()).map(|i| i == 0 || value[i] != value[i - 1]).collect();
        let repeated = fresh.iter().filter(|f| !**f).count();
        let stuck = kind != Interpolation::Kept && value.len() > 20 && repeated + 1 == value.len();
        if kind != Interpolation::Kept
            && repeated as f64 > HELD_SHARE * value.len() as f64
            && !stuck
        {
            let keep = kept(&time, &fresh);
            let mut kept = keep.iter();
            time.retain(|_| *kept.next().unwrap_or(&true));
            let mut kept = keep.iter();
            value.retain(|_| *kept.next().unwrap_or(&true));
        }
        time.shrink_to_fit();
        value.shrink_to_fit();
        if kind == Interpolation::Angle {
            unwrap(&mut value);
        }
        Channel { time: Arc::new(time), value, stuck }
    }

    /// The channel with the list of times of `other`, if its own times are the same. In a long log, equal lists would take as
    /// much memory as the values.
    pub fn sharing(mut self, other: &Channel) -> Channel {
        if self.time == other.time {
            self.time = Arc::clone(&other.time);
        }
        self
    }

    /// Whether the channel has no samples.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// Median time between samples, s; 0 for fewer than two samples.
    pub fn period(&self) -> f64 {
        let periods: Vec<f64> = self.time.windows(2).map(|w| w[1] - w[0]).collect();
        if periods.is_empty() { 0.0 } else { quantile(&periods, 0.5) }
    }

    /// Number of samples in the time from `start` to `end`, s.
    pub fn count(&self, start: f64, end: f64) -> usize {
        let (a, b) =
            (self.time.partition_point(|t| *t < start), self.time.partition_point(|t| *t <= end));
        b.saturating_sub(a)
    }

    /// The value at `t` (s) by linear interpolation between the samples before and after it. NaN if these are more than `reach`
    /// (s) apart.
    pub fn between(&self, t: f64, reach: f64) -> f64 {
        match self.around(t) {
            [_, Some((time, x))] if time == t => x,
            [Some((ta, a)), Some((tb, b))] if tb - ta <= reach => {
                a + (b - a) * (t - ta) / (tb - ta)
            }
            _ => f64::NAN,
        }
    }

    /// The measured value at `t` (s); NaN if no sample lies within `near` (s) of it.
    ///
    /// The value is interpolated by [`between`](Self::between). If the result is NaN, the nearest sample is returned instead.
    pub fn measured(&self, t: f64, reach: f64, near: f64) -> f64 {
        let [left, right] = self.around(t);
        let distance = |s: &(f64, f64)| (s.0 - t).abs();
        let nearest = [left, right]
            .into_iter()
            .flatten()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .filter(|s| distance(s) <= near);
        let Some((_, nearest)) = nearest else { return f64::NAN };
        let between = self.between(t, reach);
        if between.is_nan() { nearest } else { between }
    }

    /// The last sample before `t`, and the first one at or after `t`.
    fn around(&self, t: f64) -> [Option<(f64, f64)>; 2] {
        let after = self.time.partition_point(|x| *x < t);
        let side = |i: usize| Some((*self.time.get(i)?, *self.value.get(i)?));
        [after.checked_sub(1).and_then(side), side(after)]
    }

    /// The last sample at or before `t` (zero-order hold); NaN before the first one.
    pub fn held(&self, t: f64) -> f64 {
        let after = self.time.partition_point(|x| *x <= t);
        after.checked_sub(1).map_or(f64::NAN, |i| self.value[i])
    }
}

/// For each sample, whether it is kept when repeated values are dropped. `fresh` states for each sample whether its value differs
/// from the previous one.
fn kept(time: &[f64], fresh: &[bool]) -> Vec<bool> {
    let new: Vec<f64> = time.iter().zip(fresh).filter(|(_, f)| **f).map(|(t, _)| *t).collect();
    let periods: Vec<f64> = new.windows(2).map(|w| w[1] - w[0]).collect();
    let longest = LONGEST_PERIODS * if periods.is_empty() { 0.0 } else { quantile(&periods, 0.5) };
    let mut last = f64::NEG_INFINITY;
    let keep = |(i, t): (usize, &f64)| {
        let keep = fresh[i] || i + 1 == time.len() || t - last > longest;
        if keep {
            last = *t;
        }
        keep
    };
    time.iter().enumerate().map(keep).collect()
}

fn unwrap(angles: &mut [f64]) {
    use std::f64::consts::TAU;
    for i in 1..angles.len() {
        angles[i] -= TAU * ((angles[i] - angles[i - 1]) / TAU).round();
    }
}

/// Wraps `angle` to the range from −π to π, rad.
pub fn wrap(angle: f64) -> f64 {
    use std::f64::consts::TAU;
    angle - TAU * (angle / TAU).round()
}

/// Value and slope (per sample) of the cubic interpolation between the second and third of four samples.
///
/// `part` (0 to 1) is the position in this interval. At the second and the third sample, the cubic has the slope of the parabola
/// through that sample and its two neighbours.
///
/// Value and slope are therefore continuous from one interval to the next. A parabola through the nearest sample and its
/// neighbours would jump half-way between two samples. With noisy samples, such jumps would stop the search for a delay.
pub fn cubic<T>([a, b, c, d]: [T; 4], part: f64) -> (T, T)
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let slope = (c - a) * 0.5;
    let bend = a - b * 2.5 + c * 2.0 - d * 0.5;
    let twist = (b - c) * 1.5 + (d - a) * 0.5;
    (
        b + (slope + (bend + twist * part) * part) * part,
        slope + (bend * 2.0 + twist * (3.0 * part)) * part,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Channel with 100 Hz samples of `value`.
    fn channel(value: impl Fn(f64) -> f64) -> Channel {
        let times = (0..1000).map(|k| k as f64 * 0.01);
        Channel::new(times.map(|t| (t, value(t))), Interpolation::Linear)
    }

    #[test]
    fn a_held_sensor_has_its_own_rate_and_is_known_to_the_end() {
        let held = channel(|t| (0.5 * (t * 25.0 + 1e-9).floor() / 25.0).sin());
        assert!((held.period() - 0.04).abs() < 1e-9);
        assert!(held.between(9.99, 0.2).is_finite());
    }

    #[test]
    fn a_quantised_sensor_is_known_while_it_stays() {
        // at the maximum of the sine, about 0.6 s pass without a step of 0.05
        let coarse = channel(|t| (t.sin() / 0.05).round() * 0.05);
        assert!((0..1000).all(|k| coarse.between(k as f64 * 0.01, 0.2).is_finite()));
    }

    #[test]
    fn a_cubic_goes_through_its_samples_without_steps() {
        let samples = [0.3, -1.2, 2.0, 0.7, -0.4];
        let four = |i: usize| std::array::from_fn(|k| samples[i + k]);
        let ((value, slope), (next, onward)) = (cubic(four(0), 1.0), cubic(four(1), 0.0));
        assert!((value - 2.0).abs() < 1e-12 && (next - 2.0).abs() < 1e-12);
        assert!((slope - onward).abs() < 1e-12);
        // the returned slope is the derivative of the returned value
        let by = 1e-6;
        let rise = cubic(four(0), 0.3 + by).0 - cubic(four(0), 0.3 - by).0;
        assert!((rise / (2.0 * by) - cubic(four(0), 0.3).1).abs() < 1e-6);
    }
}
