//! Propagates the path (attitude, velocity and gust) from one sample to the next with gyros and accelerometers.

use nalgebra::{Matrix3, Vector3};

use crate::flight_path::band::{Block, Wide};
use crate::flight_path::channel::cubic;
use crate::flight_path::intake::Track;
use crate::flight_path::levels::GUST_TIME;
use crate::flight_path::nuisance::{
    self, EARTH, FORCE, FORCE_GAIN, GYRO_GAIN, INERTIAL, SKEW_FORCE, Values,
};
use crate::flight_path::path::Path;
use crate::flight_path::rotation::{self, cross, exp, log};
use greylag_logs::Sampling;

/// Propagation of the path by gyros and accelerometers. The mean rate and specific force of an interval between samples are computed
/// when they are asked for: lists of them would take much memory in a long flight.
#[derive(Clone, Copy, Debug)]
pub struct Drive<'a> {
    track: &'a Track,
    values: &'a Values,
    /// Sampling interval, s.
    step: f64,
    sampling: Sampling,
    /// Gravity, m/s².
    gravity: f64,
    has_force: bool,
    /// Correlation time of the gusts, s.
    gust_time: f64,
}

/// Means over the interval from a sample to the next one.
struct Mean {
    /// Body rate, body axes, rad/s.
    rate: Vector3<f64>,
    /// Specific force, body axes at the first sample, m/s².
    force: Vector3<f64>,
    /// Derivative of `force` with respect to the accelerometers' delay, body axes, m/s³.
    force_by_skew: Vector3<f64>,
}

/// Number of unknowns of an instant: attitude and velocity.
pub const MOTION: usize = 6;
/// Number of unknowns of an instant: attitude, velocity and the three components of the gust.
pub const MOTION_AND_GUST: usize = 9;

/// Difference between the state at the second of two samples and the state propagated from the first, with its derivatives.
///
/// The rows are attitude (rad), velocity (m/s, body axes) and gust (m/s, earth axes).
pub struct Step<const N: usize, const D: usize> {
    /// Derivatives with respect to the first sample.
    pub first: Block<N>,
    /// Derivatives with respect to the second sample.
    pub second: Block<N>,
    /// `D` columns. The last one is the negated difference. Those before it are the derivatives with respect to the constants
    /// that act between samples: errors of gyros and accelerometers, and the Earth's rate. With `D` = 1 there are none.
    pub rest: Wide<N, D>,
}

/// Writes a 3 × 3 block.
fn put<const N: usize, const W: usize>(
    into: &mut [[f64; W]; N],
    (row, column): (usize, usize),
    block: &Matrix3<f64>,
) {
    for i in 0..3 {
        for j in 0..3 {
            into[row + i][column + j] = block[(i, j)];
        }
    }
}

impl<'a> Drive<'a> {
    /// Rates and forces of `track`, corrected for the sensor errors in `values`, for the sampling interval `step` (s) and
    /// `gravity` (m/s²).
    ///
    /// Without accelerometers, the specific force is assumed to keep the velocity constant.
    pub fn new(
        track: &'a Track,
        values: &'a Values,
        step: f64,
        sampling: Sampling,
        gravity: f64,
    ) -> Drive<'a> {
        let has_force = track.force.first().is_some_and(|f| f[0].is_finite());
        Drive { track, values, step, sampling, gravity, has_force, gust_time: GUST_TIME }
    }

    /// The same with gusts of the correlation time `gust_time` (s).
    pub fn in_gusts(self, gust_time: f64) -> Drive<'a> {
        Drive { gust_time, ..self }
    }

    /// Body rates at sample `k` without the errors of the gyros, rad/s.
    fn gyro(&self, k: usize) -> Vector3<f64> {
        let Drive { track, values, .. } = *self;
        let rates = nuisance::without_gain(values, GYRO_GAIN, track.rates[k]);
        let time = track.time(k, self.step);
        Vector3::from(rates) - Vector3::from(nuisance::gyro_bias(values, time, &track.span))
    }

    /// Specific force at sample `k` without the gains and the delay of the accelerometers, body axes, m/s², and its derivative with
    /// respect to the delay, per sampling interval.
    fn own_force(&self, k: usize) -> (Vector3<f64>, Vector3<f64>) {
        let Drive { track, values, .. } = *self;
        let late = values[SKEW_FORCE] / self.step;
        let scaled = |i: usize| nuisance::without_gain(values, FORCE_GAIN, track.force[i]);
        interpolated(track.force.len(), scaled, late, k)
    }

    /// Mean rate and specific force from sample `k` to the next one.
    fn mean(&self, k: usize) -> Mean {
        let (now, step) = (self.gyro(k), self.step);
        let (rate, shares): (_, [(Matrix3<f64>, usize, f64); 2]) = match self.sampling {
            Sampling::Held => {
                let before = k.saturating_sub(1);
                let back = exp(&(self.gyro(before) * -step));
                (now, [(Matrix3::identity(), k, 1.5), (back, before, -0.5)])
            }
            Sampling::Instants => {
                let rate = (now + self.gyro(k + 1)) * 0.5;
                let on = exp(&(rate * step));
                (rate, [(Matrix3::identity(), k, 0.5), (on, k + 1, 0.5)])
            }
        };
        let (mut force, mut slope) = (Vector3::<f64>::zeros(), Vector3::<f64>::zeros());
        for (r, i, share) in shares.iter().filter(|_| self.has_force) {
            let (own, by_late) = self.own_force(*i);
            force += r * own * *share;
            slope += r * by_late * *share;
        }
        let force = if self.has_force { force } else { weight(self.track, k, self.gravity) };
        Mean { rate, force, force_by_skew: slope / step }
    }

    /// The step from sample `k` to the next sample, linearised at `path`.
    ///
    /// The gust decays with its correlation time.
    pub fn step<const N: usize, const D: usize>(&self, path: &Path, k: usize) -> Step<N, D> {
        let Drive { values, step, .. } = *self;
        let mean = self.mean(k);
        let body = path.attitude[k].transpose();
        let turned = body * path.attitude[k + 1];
        let attitude = log(&(exp(&(mean.rate * step)).transpose() * turned));
        let down = Vector3::new(0.0, 0.0, self.gravity);
        let earth = Vector3::new(values[EARTH], 0.0, values[EARTH + 1]);
        let v = path.velocity[k];
        let coriolis = earth.cross(&v) * -2.0;
        let gained = body * (path.velocity[k + 1] - v - (down + coriolis) * step);
        let bias = Vector3::from_column_slice(&values[FORCE..FORCE + 3]);
        let velocity = gained - (mean.force - bias) * step;
        let one = Matrix3::identity();
        let mut link = Step { first: [[0.0; N]; N], second: [[0.0; N]; N], rest: [[0.0; D]; N] };
        put(&mut link.first, (0, 0), &-turned.transpose());
        put(&mut link.second, (0, 0), &one);
        put(&mut link.first, (3, 0), &cross(&gained));
        put(&mut link.first, (3, 3), &-body);
        put(&mut link.second, (3, 3), &body);
        for i in 0..3 {
            link.rest[i][D - 1] = -attitude[i];
            link.rest[3 + i][D - 1] = -velocity[i];
        }
        if N == MOTION_AND_GUST {
            let kept = (-step / self.gust_time).exp();
            let gust = path.gust[k + 1] - path.gust[k] * kept;
            put(&mut link.first, (6, 6), &(one * -kept));
            put(&mut link.second, (6, 6), &one);
            (0..3).for_each(|i| link.rest[6 + i][D - 1] = -gust[i]);
        }
        if D > 1 {
            self.by_constants(&mean, &(body, v), k, &mut link.rest);
        }
        link
    }

    /// Sets the derivatives of the step from sample `k` with respect to the constants that act between samples. `mean` are the means
    /// over the step, `body` is the rotation to body axes and `v` the velocity (m/s) at sample `k`.
    fn by_constants<const N: usize, const D: usize>(
        &self,
        mean: &Mean,
        (body, v): &(Matrix3<f64>, Vector3<f64>),
        k: usize,
        rest: &mut Wide<N, D>,
    ) {
        let step = self.step;
        let time = self.track.start + (k as f64 + 0.5) * step;
        for (axis, row) in rest.iter_mut().take(3).enumerate() {
            for (place, by) in nuisance::gyro_bias_of(axis, time, &self.track.span) {
                row[place - INERTIAL] = step * by;
            }
        }
        put(rest, (3, FORCE - INERTIAL), &(Matrix3::<f64>::identity() * step));
        for i in 0..3 {
            rest[i][GYRO_GAIN + i - INERTIAL] = mean.rate[i] * step;
            rest[3 + i][FORCE_GAIN + i - INERTIAL] = mean.force[i] * step;
            rest[3 + i][SKEW_FORCE - INERTIAL] = mean.force_by_skew[i] * -step;
        }
        for (place, axis) in [(EARTH, Vector3::x()), (EARTH + 1, Vector3::z())] {
            let slope = body * axis.cross(v) * (2.0 * step);
            (0..3).for_each(|i| rest[3 + i][place - INERTIAL] = slope[i]);
        }
    }
}

/// Specific force that keeps the velocity constant at sample `k`, body axes, m/s².
fn weight(track: &Track, k: usize, gravity: f64) -> Vector3<f64> {
    let [roll, pitch, _] = track.attitude[k].map(|x| if x.is_finite() { x } else { 0.0 });
    let r = rotation::from_euler([roll, pitch, 0.0]);
    r.transpose() * Vector3::new(0.0, 0.0, -gravity)
}

/// Removes a delay of `late` sampling intervals from `samples`.
pub fn shifted(samples: &[[f64; 3]], late: f64) -> Vec<Vector3<f64>> {
    (0..samples.len()).map(|k| without_delay(samples, late, k).0).collect()
}

/// Sample `k` of `samples` without a delay of `late` sampling intervals, and its derivative with respect to the delay, per
/// sampling interval. The interpolation is cubic, from four samples.
fn without_delay(samples: &[[f64; 3]], late: f64, k: usize) -> (Vector3<f64>, Vector3<f64>) {
    interpolated(samples.len(), |i| samples[i], late, k)
}

/// The same with `count` samples that the function `sample` returns.
fn interpolated(
    count: usize,
    sample: impl Fn(usize) -> [f64; 3],
    late: f64,
    k: usize,
) -> (Vector3<f64>, Vector3<f64>) {
    let last = count as isize - 1;
    let at = |i: isize| Vector3::from(sample(i.clamp(0, last) as usize));
    let whole = late.floor();
    let i = k as isize + whole as isize;
    cubic([i - 1, i, i + 1, i + 2].map(at), late - whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lateness_is_put_right() {
        // a parabola is interpolated exactly
        let f = |t: f64| 0.3 + 0.2 * t - 0.05 * t * t;
        let samples: Vec<[f64; 3]> = (0..20).map(|k| [f(k as f64 - 0.7); 3]).collect();
        for k in 3..15 {
            let (t, (shifted, slope)) = (k as f64, without_delay(&samples, 0.7, k));
            assert!((shifted.x - f(t)).abs() < 1e-12);
            assert!((slope.x - (0.2 - 0.1 * t)).abs() < 1e-12);
        }
    }

    #[test]
    fn lateness_of_rough_samples_has_no_step() {
        let samples: Vec<[f64; 3]> = (0..20).map(|k| [f64::from(k * k % 7); 3]).collect();
        for half in [-0.5, 0.5, 1.5, 2.0] {
            let (before, after) = (shifted(&samples, half - 1e-9), shifted(&samples, half + 1e-9));
            assert!(before.iter().zip(&after).all(|(a, b)| (a - b).norm() < 1e-6), "{half}");
        }
    }
}
