//! Noise that columns share with the residual, and how much it feigns.
//!
//! Gyro noise and the path's error stand in the residual as well as in the columns, whose products are
//! then not zero on average. They are estimated by disturbing the flights once more with noise of the same
//! kind: what that adds to column and residual has the same average product.

use rand_distr::{Distribution, StandardNormal};

use super::cells::{Cells, Placed};
use super::noise::Noise;
use crate::num::stream::stream;
use crate::sysid::compare::flight::Prepared;
use crate::sysid::reconstruction::Reconstruction;

/// Random stream of the disturbance.
const DISTURBANCE: u64 = 85;

/// The path's error in V, α and β: standard deviation, and how much of it lasts a sample.
pub type PathError = [[f64; 2]; 3];

/// The path's error of a flight whose samples are `dt` (s) apart, of a steady smoother that weighs the
/// measured value against the integrated accelerations: with variances R of the measurement and q of a
/// step of the integration, its variance is √(qR)/2 and lasts √(R/q) samples.
pub fn path_error(flight: &Reconstruction, dt: f64) -> PathError {
    let [fx, fy, fz] = flight.force_noise.map(|x| if x.is_finite() { x } else { 0.0 });
    let [_, _, v, p, q, r, alpha, beta] = flight.noise.map(|x| if x.is_finite() { x } else { 0.0 });
    let speeds = flight.segments.iter().flat_map(|s| s.instants.iter().map(|i| i.state.airspeed));
    let (sum, count) = speeds.fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
    let speed: f64 = if count > 0.0 { sum / count } else { 1.0 };
    let of = |measured: f64, step: f64| {
        if measured <= 0.0 || step <= 0.0 {
            return [0.0, 0.0];
        }
        let (r, q) = (measured * measured, (step * dt).powi(2));
        [(0.5 * (q * r).sqrt()).sqrt(), (-(q / r).sqrt()).exp()]
    };
    [of(v, fx), of(alpha, (fz / speed).hypot(q)), of(beta, (fy / speed).hypot(r).hypot(0.1 * p))]
}

/// `flight` with noise of its gyros and an error of its path once more.
pub fn disturbed(flight: &Prepared, path: &PathError, seed: u64, number: usize) -> Prepared {
    let mut random = stream(seed, &[DISTURBANCE, number as u64]);
    let mut unit = || -> f64 { StandardNormal.sample(&mut random) };
    let mut out = flight.clone();
    for segment in &mut out.segments {
        let mut error = path.map(|[sd, _]| sd * unit());
        for instant in segment {
            let s = &mut instant.state;
            s.p += flight.noise[3] * unit();
            s.q += flight.noise[4] * unit();
            s.r += flight.noise[5] * unit();
            s.airspeed += error[0];
            s.alpha += error[1];
            s.beta += error[2];
            for (e, [sd, lasts]) in error.iter_mut().zip(path) {
                *e = lasts * *e + sd * (1.0 - lasts * lasts).sqrt() * unit();
            }
        }
    }
    out
}

/// Products of what a disturbance adds to the columns before `last` with what it adds to the residual in
/// the place `last`; `before` and `after` have the same columns in the same places.
pub fn products(
    cells: &Cells,
    before: &[Placed],
    after: &[Placed],
    last: usize,
    noise: &Noise,
) -> Vec<f64> {
    let mut sums = vec![0.0; last];
    for cell in &cells.list {
        let whitener = &noise.whiteners[cell.channel];
        let (places, old) = cell.matrix(&before[cell.flight], whitener);
        let (same, new) = cell.matrix(&after[cell.flight], whitener);
        let column = |place: usize| {
            let (i, j) =
                (places.iter().position(|p| *p == place)?, same.iter().position(|p| *p == place)?);
            Some(new.column(j) - old.column(i))
        };
        let Some(residual) = column(last).filter(|r| r.iter().all(|x| x.is_finite())) else {
            continue;
        };
        for place in places.iter().filter(|p| **p < last) {
            if let Some(added) = column(*place) {
                sums[*place] += added.dot(&residual);
            }
        }
    }
    sums
}
