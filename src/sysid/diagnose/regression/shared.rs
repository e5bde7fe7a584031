//! Errors-in-variables bias: spurious evidence due to noise that regressors and residual have in common.
//!
//! The path is the reconstructed airspeed, angle of attack and sideslip. The residual and the regressors both contain gyro
//! noise and the error of the path, so that the mean of their product is not zero. This bias is estimated with additional
//! simulated noise of the same distribution: it changes regressors and residual, and the products of these changes have the
//! same mean.

use rand_distr::{Distribution, StandardNormal};

use crate::diagnose::regression::cells::{Cells, Placed};
use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::noise::Noise;
use crate::flight_path::reconstruction::Reconstruction;
use crate::weak_form::prepared::Prepared;
use greylag_num::stream::stream;

/// Number of the random stream for the simulated noise.
const DISTURBANCE: u64 = 85;

/// Errors of V, α and β on the reconstructed path, by quantity: standard deviation of the sensor noise (m/s, rad, rad),
/// and factor by which the smoother's weight decreases from one sample to the next.
pub type PathError = [[f64; 2]; 3];

/// Computes the path errors of a flight with the sampling interval `dt` (s), for a steady-state smoother.
///
/// The smoother combines the measured value with a prediction from the sample before: rates are integrated, and a gust keeps its
/// value. Let R be the variance of the measurement and Q that of the prediction's step. The weight decreases by the factor z from
/// one sample to the next, with z + 1/z = 2 + Q/R (the smoother of a random walk). In gusts the memory is a few samples, so that
/// far more of the vanes' noise is left.
pub fn path_error(flight: &Reconstruction, dt: f64) -> PathError {
    let [fx, fy, fz] = flight.force_noise.map(|x| if x.is_finite() { x } else { 0.0 });
    let [_, _, v, p, q, r, alpha, beta] = flight.noise.map(|x| if x.is_finite() { x } else { 0.0 });
    let speeds = flight.segments.iter().flat_map(|s| s.instants.iter().map(|i| i.state.airspeed));
    let (sum, count) = speeds.fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
    let speed: f64 = if count > 0.0 { sum / count } else { 1.0 };
    let gust = flight.gust_step * (dt / flight.step_s).sqrt();
    let of = |measured: f64, step: f64| {
        if measured <= 0.0 || step <= 0.0 {
            [0.0, 0.0]
        } else {
            let ratio = step / measured;
            [measured, 1.0 + 0.5 * ratio * ratio - ratio * (1.0 + 0.25 * ratio * ratio).sqrt()]
        }
    };
    [
        of(v, (fx * dt).hypot(gust)),
        of(alpha, ((fz / speed).hypot(q) * dt).hypot(gust / speed)),
        of(beta, ((fy / speed).hypot(r).hypot(0.1 * p) * dt).hypot(gust / speed)),
    ]
}

/// Returns `flight` with additional simulated noise of inertial sensors, vanes and airspeed. The noise of the path is filtered
/// as in the smoother. `which` contains the index of the flight and the number of the draw.
pub fn disturbed(flight: &Prepared, path: &PathError, seed: u64, which: [usize; 2]) -> Prepared {
    let mut random = stream(seed, &[DISTURBANCE, which[0] as u64, which[1] as u64]);
    let mut unit = || -> f64 { StandardNormal.sample(&mut random) };
    let mut out = flight.clone();
    for segment in &mut out.segments {
        // for V, α, β: error of the integrated rates, and error of the measurement minus error of the integrated rates
        let mut drift: [Vec<f64>; 3] = Default::default();
        let mut measured: [Vec<f64>; 3] = Default::default();
        let mut sum = [0.0; 3];
        for instant in segment.iter_mut() {
            let s = &mut instant.state;
            let rates = [3, 4, 5].map(|k| flight.noise[k] * unit());
            let forces = flight.force_noise.map(|sd| sd * unit());
            for k in 0..3 {
                drift[k].push(sum[k]);
                measured[k].push(path[k][0] * unit() - sum[k]);
            }
            let (sin, cos) = s.alpha.sin_cos();
            let v = s.airspeed.max(1.0);
            sum[0] += forces[0] * flight.dt;
            sum[1] += (rates[1] + forces[2] / v) * flight.dt;
            sum[2] += (rates[0] * sin - rates[2] * cos + forces[1] / v) * flight.dt;
            (s.p, s.q, s.r) = (s.p + rates[0], s.q + rates[1], s.r + rates[2]);
            (0..3).for_each(|k| instant.specific_force[k] += forces[k]);
        }
        for k in 0..3 {
            if path[k][0] <= 0.0 {
                continue;
            }
            let kept = path[k][1];
            let low = both_ways(&measured[k], kept);
            for ((instant, drift), low) in segment.iter_mut().zip(&drift[k]).zip(low) {
                let s = &mut instant.state;
                *[&mut s.airspeed, &mut s.alpha, &mut s.beta][k] += drift + low;
            }
        }
    }
    out
}

/// Filters `x` forward and backward with first-order low-pass filters with the pole `kept`. Each filter starts from the
/// mean of the first samples within its memory.
fn both_ways(x: &[f64], kept: f64) -> Vec<f64> {
    let pass = |x: &mut dyn Iterator<Item = f64>, start: f64| {
        let mut y = start;
        x.map(|x| {
            y = kept * y + (1.0 - kept) * x;
            y
        })
        .collect::<Vec<f64>>()
    };
    let memory = ((1.0 - kept).recip().ceil() as usize).clamp(1, x.len().max(1));
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let forward = pass(&mut x.iter().copied(), mean(&x[..memory.min(x.len())]));
    let end = mean(&forward[forward.len().saturating_sub(memory)..]);
    let mut back = pass(&mut forward.iter().rev().copied(), end);
    back.reverse();
    back
}

/// Products of the changes of columns and residual that simulated noise causes, by flight and index of the column.
///
/// `before` are the columns without simulated noise, `after` those with it. The residual has the index `last`, and all other
/// columns have smaller indices.
pub fn products(
    cells: &Cells,
    before: &[Placed],
    after: &[Placed],
    last: usize,
    noise: &Noise,
) -> Vec<Vec<f64>> {
    let added: Vec<Placed> = before.iter().zip(after).map(|(b, a)| differences(b, a)).collect();
    let mut sums = vec![vec![0.0; last]; before.len()];
    for cell in &cells.list {
        let (places, columns) = cell.matrix(&added[cell.flight], &noise.whiteners[cell.channel]);
        let Some(residual) = places.iter().position(|p| *p == last) else { continue };
        let residual = columns.column(residual);
        if residual.iter().any(|x| !x.is_finite()) {
            continue;
        }
        for (place, column) in places.iter().zip(columns.column_iter()) {
            if *place < last {
                sums[cell.flight][*place] += column.dot(&residual);
            }
        }
    }
    sums
}

/// Columns of `after` minus the columns of `before` with the same index. A channel that is empty in either stays empty.
fn differences(before: &Placed, after: &Placed) -> Placed {
    let of = |(place, new): &(usize, Column)| {
        let (_, old) = before.iter().find(|(p, _)| p == place)?;
        let channel = |c: usize| new[c].iter().zip(&old[c]).map(|(a, b)| a - b).collect();
        Some((*place, std::array::from_fn(channel)))
    };
    after.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_gusts_the_path_forgets_within_a_sample_or_two() {
        let of = |gust_step: f64| {
            let noise = [0.0, 0.0, 0.3, 0.005, 0.005, 0.005, 0.005, 0.005];
            let empty = Reconstruction::empty("f");
            let flight = Reconstruction { noise, force_noise: [0.1; 3], gust_step, ..empty };
            path_error(&flight, 0.01)[0]
        };
        // the integrated accelerometer wanders by 1 mm/s in a sample, beside 0.3 m/s of noise
        let [sd, kept] = of(0.0);
        assert!(sd == 0.3 && (kept - (-0.001_f64 / 0.3).exp()).abs() < 1e-8, "{sd} {kept}");
        // a gust that changes by as much as the noise: z + 1/z = 3
        let [_, kept] = of(0.3);
        assert!((kept + kept.recip() - 3.0).abs() < 1e-4, "{kept}");
    }
}
