//! Equation-error fit in weak form: the equations of motion are integrated over short windows against a smooth kernel, so that
//! no data are differentiated. The fit converges from poor initial values and provides starting values for the output-error fit.

use std::cmp::Ordering;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::flight::Flight;
use super::parameters::{self, Free};
use crate::weak_form::windows;
use greylag_model::GreyBox;

/// Number of fitted channels: three forces (unknown without accelerometers) and three moments.
const CHANNELS: usize = 6;
/// Largest number of iterations of one search.
const ITERATIONS: usize = 5;
/// Number of iterations from each of several starting points. The best result is then continued.
const TRIAL: usize = 2;
/// Largest number of starting points. Two effect files with three shape constants each can give thousands of combinations.
const MOST_STARTS: usize = 256;
/// The search ends if the predicted decrease of the weighted sum of squares is at most this. A change by a tenth of a
/// standard deviation gives this decrease.
const COST_TOLERANCE: f64 = 0.01;
/// Number of independent samples for which a window counts. It is one half, because windows overlap by half.
const INDEPENDENT_FRACTION: f64 = 0.5;

/// Estimates the free coefficients of `model` from forces and moments in weak form. Of several starting points, the best is
/// continued.
pub(super) fn start(model: &GreyBox, free: &[Free], flights: &[Flight]) -> Vec<f64> {
    let starts = starts(free);
    let trials = if starts.len() > 1 { TRIAL } else { 0 };
    let tried: Vec<(Misfit, Vec<f64>)> =
        starts.into_par_iter().map(|theta| search(model, free, flights, theta, trials)).collect();
    let best = tried.into_iter().min_by(|a, b| a.0.order(&b.0));
    let theta = best.map_or_else(|| free.iter().map(|f| f.prior).collect(), |(_, theta)| theta);
    search(model, free, flights, theta, ITERATIONS).1
}

/// Starting points of the search: the prior means, with every combination of the starting values that the catalogue of known
/// effects states for the shape constants of added effects. Shape constants are the coefficients in which an effect is nonlinear.
/// A constant that would lead to more than [`MOST_STARTS`] combinations keeps its prior mean.
fn starts(free: &[Free]) -> Vec<Vec<f64>> {
    let mut starts: Vec<Vec<f64>> = vec![free.iter().map(|f| f.prior).collect()];
    for (k, f) in free.iter().enumerate().filter(|(_, f)| f.added && !f.linear) {
        let Some((id, short)) = f.name.split_once('.') else { continue };
        let Some((about, _)) = parameters::describe(id) else { continue };
        let entry = about.entry.map_or(&[][..], |e| e.starts);
        let Some(place) = about.coefficients.iter().position(|c| c.name == short) else { continue };
        let mut values: Vec<f64> = entry.iter().map(|s| s[place]).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        starts = combined(starts, k, &values);
    }
    starts
}

/// Combines each of `starts` with each of `values` as its element `place`. Returns `starts` unchanged if there are fewer than
/// two values or if there would be more than [`MOST_STARTS`] combinations.
fn combined(starts: Vec<Vec<f64>>, place: usize, values: &[f64]) -> Vec<Vec<f64>> {
    if values.len() < 2 || starts.len() * values.len() > MOST_STARTS {
        return starts;
    }
    let each = |value: &f64| starts.iter().map(|s| replaced(s, place, *value)).collect::<Vec<_>>();
    values.iter().flat_map(each).collect()
}

fn replaced(values: &[f64], place: usize, value: f64) -> Vec<f64> {
    let mut values = values.to_vec();
    values[place] = value;
    values
}

/// Residuals (measured minus predicted) of all channels and flights in one list, with the channel of each.
struct Residuals {
    values: Vec<f64>,
    channel: Vec<usize>,
}

fn residuals(model: &GreyBox, flights: &[Flight]) -> Residuals {
    let windows: Vec<Vec<[f64; 6]>> = flights
        .par_iter()
        .map(|flight| windows::force_and_moment_residuals(model, &flight.prepared))
        .collect();
    let mut all = Residuals { values: Vec::new(), channel: Vec::new() };
    for flight in windows {
        for channel in 0..CHANNELS {
            all.values.extend(flight.iter().map(|w| w[channel]));
            all.channel.extend(std::iter::repeat_n(channel, flight.len()));
        }
    }
    all
}

/// Gauss–Newton search from the coefficients `theta`. Returns the smallest misfit that was found and the coefficients that give
/// it.
fn search(
    model: &GreyBox,
    free: &[Free],
    flights: &[Flight],
    mut theta: Vec<f64>,
    iterations: usize,
) -> (Misfit, Vec<f64>) {
    let mut best = (Misfit::WORST, theta.clone());
    for iteration in 0..=iterations {
        let present = parameters::with(model, free, &theta);
        let r = residuals(&present, flights);
        let weights = weights(&r);
        let cost = misfit(&r);
        if cost.order(&best.0).is_lt() {
            best = (cost, theta.clone());
        }
        if iteration == iterations {
            break;
        }
        let next = step(&present, free, flights, &theta, &r, &weights);
        let Some(Step { change, .. }) = next.filter(|step| step.gain > COST_TOLERANCE) else {
            break;
        };
        for (k, f) in free.iter().enumerate() {
            let change = change[k].clamp(-f.stride, f.stride);
            theta[k] = (theta[k] + change).clamp(f.bounds.0, f.bounds.1);
        }
    }
    best
}

/// Inverse variances of the channels' residuals.
fn weights(r: &Residuals) -> [f64; CHANNELS] {
    std::array::from_fn(|k| 1.0 / mean_square(r, k))
}

/// Mean square of a channel's residuals. It is 1 if no residual is finite; the channel then adds zero to the sum of logarithms
/// in the misfit.
fn mean_square(r: &Residuals, channel: usize) -> f64 {
    let own = r.values.iter().zip(&r.channel).filter(|(x, c)| **c == channel && x.is_finite());
    let (sum, n) = own.fold((0.0, 0.0), |(s, n), (x, _)| (s + x * x, n + 1.0));
    if n > 0.0 { sum / n } else { 1.0 }
}

/// Misfit between the flights and the predictions of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Misfit {
    /// Number of channels without a finite residual. Unmeasured channels are included and are the same for all coefficients. If
    /// the number is larger, predictions are NaN. A misfit with the larger number is therefore the worse one, whatever its
    /// `cost`.
    missing: usize,
    /// Concentrated negative log-likelihood: sum of the logarithms of the channels' mean square residuals.
    cost: f64,
}

impl Misfit {
    const WORST: Misfit = Misfit { missing: usize::MAX, cost: f64::INFINITY };

    fn order(&self, other: &Misfit) -> Ordering {
        self.missing.cmp(&other.missing).then(self.cost.total_cmp(&other.cost))
    }
}

fn misfit(r: &Residuals) -> Misfit {
    let finite = |k: usize| r.values.iter().zip(&r.channel).any(|(x, c)| *c == k && x.is_finite());
    Misfit {
        missing: (0..CHANNELS).filter(|k| !finite(*k)).count(),
        cost: (0..CHANNELS).map(|k| mean_square(r, k).max(1e-12).ln()).sum(),
    }
}

/// A step of the Gauss–Newton search.
struct Step {
    /// Change of each free coefficient.
    change: DVector<f64>,
    /// Decrease of the weighted sum of squares that the linearised model predicts.
    gain: f64,
}

fn step(
    present: &GreyBox,
    free: &[Free],
    flights: &[Flight],
    theta: &[f64],
    r: &Residuals,
    weights: &[f64; CHANNELS],
) -> Option<Step> {
    let columns: Vec<windows::Columns> =
        flights.par_iter().map(|f| windows::columns(present, &f.prepared)).collect();
    let column = |(k, f): (usize, &Free)| {
        let known = columns.iter().flat_map(|c| c.values[f.index].iter().flatten().copied());
        let known: Vec<f64> = known.collect();
        if f.linear && known.iter().any(|x| *x != 0.0) {
            return known;
        }
        let (low, high, between) = parameters::beside(present, free, theta, k);
        let low = low.map_or_else(|| r.values.clone(), |m| residuals(&m, flights).values);
        let high = residuals(&high, flights).values;
        low.iter().zip(high).map(|(a, b)| (a - b) / between).collect()
    };
    let j: Vec<Vec<f64>> = free.iter().enumerate().map(column).collect();
    let weight = |row: usize| INDEPENDENT_FRACTION * weights[r.channel[row]];
    let used: Vec<usize> = (0..r.values.len())
        .filter(|row| r.values[*row].is_finite() && j.iter().all(|c| c[*row].is_finite()))
        .collect();
    let rooted = |row: usize, x: f64| weight(row).sqrt() * x;
    let x = DMatrix::from_fn(used.len(), free.len(), |i, k| rooted(used[i], j[k][used[i]]));
    let y = DVector::from_fn(used.len(), |i, _| rooted(used[i], r.values[used[i]]));
    let mut information = x.tr_mul(&x);
    let mut right = x.tr_mul(&y);
    for (k, f) in free.iter().enumerate() {
        information[(k, k)] += f.width.powi(-2);
        right[k] -= (theta[k] - f.prior) * f.width.powi(-2);
    }
    let scale = information.diagonal().map(|d| d.sqrt().recip());
    let scaled =
        DMatrix::from_fn(free.len(), free.len(), |a, b| information[(a, b)] * scale[a] * scale[b]);
    let mut change = scaled.cholesky()?.solve(&right.component_mul(&scale));
    change.component_mul_assign(&scale);
    let gain = change.dot(&right);
    Some(Step { change, gain })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predictions_that_are_no_numbers_lose_against_poor_ones() {
        // the first channel is not measured
        let of = |roll: f64| Residuals {
            values: vec![f64::NAN, 10.0, 10.0, 10.0, roll, 10.0],
            channel: (0..CHANNELS).collect(),
        };
        let (none, poor) = (misfit(&of(f64::NAN)), misfit(&of(1e6)));
        assert_eq!((none.missing, poor.missing), (2, 1));
        assert!(none.cost < poor.cost && poor.order(&none).is_lt());
        assert!(misfit(&of(1.0)).order(&poor).is_lt() && none.order(&Misfit::WORST).is_lt());
    }

    #[test]
    fn the_number_of_starting_points_is_bounded() {
        let mut starts = vec![vec![0.0; 10]];
        for place in 0..10 {
            starts = combined(starts, place, &[1.0, 2.0, 3.0, 4.0]);
        }
        assert_eq!(starts.len(), MOST_STARTS);
        assert!(starts.iter().all(|s| s[..4].iter().all(|x| *x > 0.0) && s[4..] == [0.0; 6]));
        assert_eq!(combined(vec![vec![0.0]], 0, &[1.0]), [[0.0]]);
    }
}
