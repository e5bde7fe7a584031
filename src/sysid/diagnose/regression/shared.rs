//! Noise shared by columns and residual, and the spurious evidence it causes.
//!
//! Gyro noise and the path's error enter the residual as well as the columns, so their products are not zero on
//! average. The bias is estimated by disturbing the flights again with noise of the same kind: the products of the
//! resulting changes of column and residual have the same mean.

use rand_distr::{Distribution, StandardNormal};

use crate::diagnose::regression::cells::{Cells, Placed};
use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::noise::Noise;
use crate::flight_path::reconstruction::Reconstruction;
use crate::weak_form::prepared::Prepared;
use greylag_num::stream::stream;

/// Random stream for the disturbance.
const DISTURBANCE: u64 = 85;

/// Error of the path's V, α and β: noise of their sensors, and the share of the past that the smoother keeps in a
/// sample.
pub type PathError = [[f64; 2]; 3];

/// The steady-state smoother of a flight with a sampling interval of `dt` (s), which weighs the measured value
/// against the integrated rates: with variances R of the measurement and q of an integration step, its memory is
/// √(R/q) samples to either side.
pub fn path_error(flight: &Reconstruction, dt: f64) -> PathError {
    let [fx, fy, fz] = flight.force_noise.map(|x| if x.is_finite() { x } else { 0.0 });
    let [_, _, v, p, q, r, alpha, beta] = flight.noise.map(|x| if x.is_finite() { x } else { 0.0 });
    let speeds = flight.segments.iter().flat_map(|s| s.instants.iter().map(|i| i.state.airspeed));
    let (sum, count) = speeds.fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
    let speed: f64 = if count > 0.0 { sum / count } else { 1.0 };
    let of = |measured: f64, rate: f64| {
        if measured <= 0.0 || rate <= 0.0 {
            [0.0, 0.0]
        } else {
            [measured, (-rate * dt / measured).exp()]
        }
    };
    [of(v, fx), of(alpha, (fz / speed).hypot(q)), of(beta, (fy / speed).hypot(r).hypot(0.1 * p))]
}

/// `flight` disturbed again with noise of its inertial sensors, vanes and airspeed, filtered as by the smoother of
/// its path; `which` holds the index of the flight and that of the draw.
pub fn disturbed(flight: &Prepared, path: &PathError, seed: u64, which: [usize; 2]) -> Prepared {
    let mut random = stream(seed, &[DISTURBANCE, which[0] as u64, which[1] as u64]);
    let mut unit = || -> f64 { StandardNormal.sample(&mut random) };
    let mut out = flight.clone();
    for segment in &mut out.segments {
        // V, α, β: error of the integrated rates, and the measurement's error less that one
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

/// First-order low-pass filters forward and backward, which keep `kept` of the past; they start from the mean of the
/// first samples within their memory.
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

/// Products of a disturbance's changes of the columns before `last` with its change of the residual at index `last`,
/// by flight; the same index in `before` and `after` means the same column.
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

/// `after` less `before`, index by index; channels missing in one of them stay empty.
fn differences(before: &Placed, after: &Placed) -> Placed {
    let of = |(place, new): &(usize, Column)| {
        let (_, old) = before.iter().find(|(p, _)| p == place)?;
        let channel = |c: usize| new[c].iter().zip(&old[c]).map(|(a, b)| a - b).collect();
        Some((*place, std::array::from_fn(channel)))
    };
    after.iter().filter_map(of).collect()
}
