//! The inertial part: how gyros and accelerometers carry the path from one sample to the next.

use nalgebra::{Matrix3, Vector3};

use super::Timing;
use super::band::{Block, Border, NodeVector};
use super::intake::Track;
use super::nuisance::{EARTH, FORCE, GYRO, SKEW_FORCE, Values};
use super::path::Path;
use super::rotation::{cross, exp, log};

/// Time over which a gust is forgotten, s: the length scale of turbulence some hundred metres up over
/// the airspeed of a small aircraft.
const GUST_TIME: f64 = 20.0;

/// The part of a gust that is left after `step`, s.
pub fn gust_kept(step: f64) -> f64 {
    (-step / GUST_TIME).exp()
}

/// Mean rates and forces over each interval, as the gyros and accelerometers have them.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Mean rate from each sample to the next, body axes, rad/s.
    rate: Vec<Vector3<f64>>,
    /// Mean specific force from each sample to the next, axes of the body at the first one, m/s².
    force: Vec<Vector3<f64>>,
    /// Its change with the delay of the accelerometers, m/s³.
    force_by_skew: Vec<Vector3<f64>>,
}

/// The difference between one sample carried on and the next one, and how it depends on both.
pub struct Link {
    /// Attitude (rad), velocity (m/s, body axes), gust (m/s, earth axes).
    pub residual: NodeVector,
    /// By the first sample.
    pub first: Block,
    /// By the second sample.
    pub second: Block,
    /// By the constants.
    pub constants: Border,
}

impl Drive {
    /// The drive of `track` at the constants `values`, samples `step` (s) apart.
    ///
    /// Without accelerometers the velocity is carried on unchanged.
    pub fn new(track: &Track, values: &Values, step: f64, timing: Timing, gravity: f64) -> Drive {
        let n = track.len();
        let bias = Vector3::from_column_slice(&values[GYRO..GYRO + 3]);
        let gyro = |k: usize| Vector3::from(track.rates[k]) - bias;
        let (force, slope) = shifted(&track.force, values[SKEW_FORCE] / step);
        let has_force = track.force.first().is_some_and(|f| f[0].is_finite());
        let mut drive = Drive { rate: vec![], force: vec![], force_by_skew: vec![] };
        for k in 0..n - 1 {
            let (rate, mean): (_, [(Matrix3<f64>, usize, f64); 2]) = match timing {
                Timing::Held => {
                    let before = k.saturating_sub(1);
                    let back = exp(&(gyro(before) * -step));
                    (gyro(k), [(Matrix3::identity(), k, 1.5), (back, before, -0.5)])
                }
                Timing::Sampled => {
                    let rate = (gyro(k) + gyro(k + 1)) * 0.5;
                    let on = exp(&(rate * step));
                    (rate, [(Matrix3::identity(), k, 0.5), (on, k + 1, 0.5)])
                }
            };
            let mix = |of: &[Vector3<f64>]| {
                mean.iter().map(|(r, i, share)| r * of[*i] * *share).sum::<Vector3<f64>>()
            };
            drive.rate.push(rate);
            drive.force.push(if has_force { mix(&force) } else { weight(track, k, gravity) });
            drive.force_by_skew.push(if has_force { mix(&slope) / step } else { Vector3::zeros() });
        }
        drive
    }

    /// The link between samples `k` and `k + 1` of `path`.
    ///
    /// The gust decays over [`GUST_TIME`].
    pub fn link(&self, path: &Path, values: &Values, k: usize, step: f64, gravity: f64) -> Link {
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
        let mut link = Link {
            residual: NodeVector::zeros(),
            first: Block::zeros(),
            second: Block::zeros(),
            constants: Border::zeros(),
        };
        link.residual.fixed_rows_mut::<3>(0).copy_from(&attitude);
        link.residual.fixed_rows_mut::<3>(3).copy_from(&velocity);
        let (one, kept) = (Matrix3::identity(), gust_kept(step));
        let gust = path.gust[k + 1] - path.gust[k] * kept;
        link.residual.fixed_rows_mut::<3>(6).copy_from(&gust);
        link.first.fixed_view_mut::<3, 3>(6, 6).copy_from(&(one * -kept));
        link.second.fixed_view_mut::<3, 3>(6, 6).copy_from(&one);
        link.first.fixed_view_mut::<3, 3>(0, 0).copy_from(&-turned.transpose());
        link.second.fixed_view_mut::<3, 3>(0, 0).copy_from(&one);
        link.first.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross(&gained));
        link.first.fixed_view_mut::<3, 3>(3, 3).copy_from(&-body);
        link.second.fixed_view_mut::<3, 3>(3, 3).copy_from(&body);
        link.constants.fixed_view_mut::<3, 3>(0, GYRO).copy_from(&(one * step));
        link.constants.fixed_view_mut::<3, 3>(3, FORCE).copy_from(&(one * step));
        for (place, axis) in [(EARTH, Vector3::x()), (EARTH + 1, Vector3::z())] {
            let slope = body * axis.cross(&v) * (2.0 * step);
            link.constants.fixed_view_mut::<3, 1>(3, place).copy_from(&slope);
        }
        let by_skew = self.force_by_skew[k] * -step;
        link.constants.fixed_view_mut::<3, 1>(3, SKEW_FORCE).copy_from(&by_skew);
        link
    }
}

/// The specific force that holds the velocity where it is.
fn weight(track: &Track, k: usize, gravity: f64) -> Vector3<f64> {
    let [roll, pitch, _] = track.attitude[k].map(|x| if x.is_finite() { x } else { 0.0 });
    let r = super::rotation::from_euler([roll, pitch, 0.0]);
    r.transpose() * Vector3::new(0.0, 0.0, -gravity)
}

/// `samples` that came `late` samples late, put right by parabolas through three of them, with the
/// change of each by one more sample of lateness.
pub fn shifted(samples: &[[f64; 3]], late: f64) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let last = samples.len() as isize - 1;
    let at = |i: isize| Vector3::from(samples[i.clamp(0, last) as usize]);
    let whole = late.round();
    let part = late - whole;
    (0..=last)
        .map(|k| {
            let i = k + whole as isize;
            let (a, b, c) = (at(i - 1), at(i), at(i + 1));
            let (slope, bend) = ((c - a) * 0.5, a - b * 2.0 + c);
            (b + slope * part + bend * (0.5 * part * part), slope + bend * part)
        })
        .unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lateness_is_put_right() {
        // a parabola is interpolated exactly
        let f = |t: f64| 0.3 + 0.2 * t - 0.05 * t * t;
        let samples: Vec<[f64; 3]> = (0..20).map(|k| [f(k as f64 - 0.7); 3]).collect();
        let (shifted, slope) = shifted(&samples, 0.7);
        for k in 3..15 {
            let t = k as f64;
            assert!((shifted[k].x - f(t)).abs() < 1e-12);
            assert!((slope[k].x - (0.2 - 0.1 * t)).abs() < 1e-12);
        }
    }
}
