//! Propagates the path (attitude, velocity and gust) from one sample to the next with gyros and accelerometers.

use nalgebra::{Matrix3, Vector3};

use crate::flight_path::band::{Block, Wide};
use crate::flight_path::channel::cubic;
use crate::flight_path::intake::{Span, Track};
use crate::flight_path::levels::GUST_TIME;
use crate::flight_path::nuisance::{
    self, EARTH, FORCE, FORCE_GAIN, GYRO_GAIN, INERTIAL, SKEW_FORCE, Values,
};
use crate::flight_path::path::Path;
use crate::flight_path::rotation::{self, cross, exp, log};
use greylag_logs::Sampling;

/// Mean body rates and specific forces over each interval between samples, from gyros and accelerometers.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Mean rate from each sample to the next, body axes, rad/s.
    rate: Vec<Vector3<f64>>,
    /// Mean specific force from each sample to the next, body axes at the first sample, m/s².
    force: Vec<Vector3<f64>>,
    /// Derivative of `force` with respect to the accelerometers' delay, body axes, m/s³.
    force_by_skew: Vec<Vector3<f64>>,
    /// Correlation time of the gusts, s.
    gust_time: f64,
    /// Time of the first sample, s.
    start: f64,
    /// Extent in time of the flight.
    span: Span,
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

impl Drive {
    /// Rates and forces of `track`, corrected for the sensor errors in `values`, for the sampling interval `step` (s) and
    /// `gravity` (m/s²).
    ///
    /// Without accelerometers, the specific force is assumed to keep the velocity constant.
    pub fn new(
        track: &Track,
        values: &Values,
        step: f64,
        sampling: Sampling,
        gravity: f64,
    ) -> Drive {
        let n = track.len();
        let gyro = |k: usize| {
            Vector3::from(nuisance::without_gain(values, GYRO_GAIN, track.rates[k]))
                - Vector3::from(nuisance::gyro_bias(values, track.time(k, step), &track.span))
        };
        let scaled: Vec<[f64; 3]> =
            track.force.iter().map(|f| nuisance::without_gain(values, FORCE_GAIN, *f)).collect();
        let late = values[SKEW_FORCE] / step;
        let has_force = track.force.first().is_some_and(|f| f[0].is_finite());
        let (start, span) = (track.start, track.span);
        let [rate, force, force_by_skew] = std::array::from_fn(|_| Vec::with_capacity(n - 1));
        let gust_time = GUST_TIME;
        let mut drive = Drive { rate, force, force_by_skew, gust_time, start, span };
        let (mut before, mut now) = (gyro(0), gyro(0));
        for k in 0..n - 1 {
            let after = gyro(k + 1);
            let (rate, mean): (_, [(Matrix3<f64>, usize, f64); 2]) = match sampling {
                Sampling::Held => {
                    let back = exp(&(before * -step));
                    (now, [(Matrix3::identity(), k, 1.5), (back, k.saturating_sub(1), -0.5)])
                }
                Sampling::Instants => {
                    let rate = (now + after) * 0.5;
                    let on = exp(&(rate * step));
                    (rate, [(Matrix3::identity(), k, 0.5), (on, k + 1, 0.5)])
                }
            };
            let (mut force, mut slope) = (Vector3::<f64>::zeros(), Vector3::<f64>::zeros());
            for (r, i, share) in mean.iter().filter(|_| has_force) {
                let (own, by_late) = without_delay(&scaled, late, *i);
                force += r * own * *share;
                slope += r * by_late * *share;
            }
            drive.rate.push(rate);
            drive.force.push(if has_force { force } else { weight(track, k, gravity) });
            drive.force_by_skew.push(slope / step);
            (before, now) = (now, after);
        }
        drive
    }

    /// The same with gusts of the correlation time `gust_time` (s).
    pub fn in_gusts(self, gust_time: f64) -> Drive {
        Drive { gust_time, ..self }
    }

    /// The step from sample `k` to the next sample, linearised at `path`.
    ///
    /// The gust decays with its correlation time.
    pub fn step<const N: usize, const D: usize>(
        &self,
        path: &Path,
        values: &Values,
        k: usize,
        step: f64,
        gravity: f64,
    ) -> Step<N, D> {
        let body = path.attitude[k].transpose();
        let turned = body * path.attitude[k + 1];
        let attitude = log(&(exp(&(self.rate[k] * step)).transpose() * turned));
        let down = Vector3::new(0.0, 0.0, gravity);
        let earth = Vector3::new(values[EARTH], 0.0, values[EARTH + 1]);
        let v = path.velocity[k];
        let coriolis = earth.cross(&v) * -2.0;
        let gained = body * (path.velocity[k + 1] - v - (down + coriolis) * step);
        let bias = Vector3::from_column_slice(&values[FORCE..FORCE + 3]);
        let velocity = gained - (self.force[k] - bias) * step;
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
            let time = self.start + (k as f64 + 0.5) * step;
            for axis in 0..3 {
                for (place, by) in nuisance::gyro_bias_of(axis, time, &self.span) {
                    link.rest[axis][place - INERTIAL] = step * by;
                }
            }
            put(&mut link.rest, (3, FORCE - INERTIAL), &(one * step));
            for i in 0..3 {
                link.rest[i][GYRO_GAIN + i - INERTIAL] = self.rate[k][i] * step;
                link.rest[3 + i][FORCE_GAIN + i - INERTIAL] = self.force[k][i] * step;
                link.rest[3 + i][SKEW_FORCE - INERTIAL] = self.force_by_skew[k][i] * -step;
            }
            for (place, axis) in [(EARTH, Vector3::x()), (EARTH + 1, Vector3::z())] {
                let slope = body * axis.cross(&v) * (2.0 * step);
                (0..3).for_each(|i| link.rest[3 + i][place - INERTIAL] = slope[i]);
            }
        }
        link
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
    let last = samples.len() as isize - 1;
    let at = |i: isize| Vector3::from(samples[i.clamp(0, last) as usize]);
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
