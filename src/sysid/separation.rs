//! Separation of two candidate effects by flights: how well the flights distinguish them after a refit of the model.

use nalgebra::{DMatrix, DVector};

use crate::weak_form::prepared::Prepared;
use crate::weak_form::windows::{channels, columns};
use greylag_model::GreyBox;

/// Number of channels used: D, L, Y, l, m, n.
const CHANNELS: usize = 6;
/// Ridge parameter of a free column, relative to the column's squared norm. It keeps a system with equal columns solvable.
const RIDGE: f64 = 1e-9;
/// Prior width of a sensor's constant error in a channel, in standard deviations of a window's noise.
const BIAS_WIDTH: f64 = 100.0;

/// Squared difference in predictions due to an effect, in noise variances, after a refit. This is the unit of evidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// Squared difference that remains after the coefficients are refitted: a measure of the effect's detectability.
    pub visible: f64,
    /// Squared difference that remains after the other effect is also fitted.
    pub apart: f64,
}

/// Separation, by `flight`, of an effect from another effect. `truth` has the effect; `base` has neither of them.
///
/// `others` holds the alternatives for fitting the other effect. An alternative is a set of models whose differences from
/// `base` are scaled freely.
///
/// The coefficients of `base` and a constant error in every channel are refitted within their prior widths.
pub fn separation(
    base: &GreyBox,
    truth: &GreyBox,
    others: &[Vec<GreyBox>],
    flight: &Prepared,
) -> Separation {
    let scale = noise(base, flight);
    let lacks = residual(base, flight, &scale);
    let gap = &lacks - residual(truth, flight, &scale);
    let prior = refitted(base, flight, &scale);
    let direction = |other: &GreyBox| &lacks - residual(other, flight, &scale);
    let left = |way: &[GreyBox]| remaining(&prior, way.iter().map(direction).collect(), &gap);
    let apart = others.iter().map(|way| left(way)).fold(f64::INFINITY, f64::min);
    let visible = left(&[]);
    Separation { visible, apart: apart.min(visible) }
}

/// Standard deviation of each channel's noise, in the channel's unit; infinite for a channel that is not measured.
fn noise(model: &GreyBox, flight: &Prepared) -> [f64; CHANNELS] {
    let mut scale = [f64::INFINITY; CHANNELS];
    for series in channels(model, flight) {
        let k = series.channel as usize;
        if k < CHANNELS && series.noise_variance > 0.0 {
            scale[k] = series.noise_variance.sqrt();
        }
    }
    scale
}

/// Measured less predicted in standard deviations of noise, in the order of channels, then windows; 0 if not measured.
fn residual(model: &GreyBox, flight: &Prepared, scale: &[f64; CHANNELS]) -> DVector<f64> {
    let windows = flight.windows.len();
    let mut all = DVector::zeros(CHANNELS * windows);
    for series in channels(model, flight) {
        let k = series.channel as usize;
        if k < CHANNELS {
            let both = series.measured.iter().zip(&series.predicted);
            both.enumerate().for_each(|(w, (measured, predicted))| {
                let x = (measured - predicted) / scale[k];
                all[k * windows + w] = if x.is_finite() { x } else { 0.0 };
            });
        }
    }
    all
}

/// Regression columns of all refitted parameters, each multiplied by the prior width of its parameter.
fn refitted(base: &GreyBox, flight: &Prepared, scale: &[f64; CHANNELS]) -> Vec<DVector<f64>> {
    let windows = flight.windows.len();
    let found = columns(base, flight);
    let linear = base.linear();
    let mut all = Vec::new();
    for (k, values) in found.values.iter().enumerate() {
        let width = base.coefficients()[k].width();
        if linear[k] && width > 0.0 {
            let at = |i: usize| width * values[i / windows][i % windows] / scale[i / windows];
            all.push(DVector::from_iterator(CHANNELS * windows, (0..CHANNELS * windows).map(at)));
        }
    }
    for channel in 0..CHANNELS {
        let constant = |i: usize| if i / windows == channel { BIAS_WIDTH } else { 0.0 };
        all.push(DVector::from_iterator(CHANNELS * windows, (0..CHANNELS * windows).map(constant)));
    }
    all
}

/// Squared norm of `gap` after a least-squares fit of the columns `prior` and `free` is subtracted. The coefficients of
/// `prior` have a prior with unit variance.
fn remaining(prior: &[DVector<f64>], free: Vec<DVector<f64>>, gap: &DVector<f64>) -> f64 {
    let free = free.into_iter().filter(|column| column.norm_squared() > 0.0);
    let columns: Vec<DVector<f64>> = prior.iter().cloned().chain(free).collect();
    if columns.is_empty() {
        return gap.norm_squared();
    }
    let all = DMatrix::from_columns(&columns);
    let mut normal = all.transpose() * &all;
    for k in 0..columns.len() {
        normal[(k, k)] += if k < prior.len() { 1.0 } else { RIDGE * normal[(k, k)] };
    }
    let right = all.transpose() * gap;
    let Some(factor) = normal.cholesky() else { return 0.0 };
    (gap.norm_squared() - right.dot(&factor.solve(&right))).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_prior_or_the_other_can_take_is_not_left() {
        let unit = |k: usize| DVector::from_fn(3, |i, _| if i == k { 1.0 } else { 0.0 });
        let gap = DVector::from_vec(vec![3.0, 4.0, 12.0]);
        assert!((remaining(&[], Vec::new(), &gap) - 169.0).abs() < 1e-9);
        assert!((remaining(&[], vec![unit(2)], &gap) - 25.0).abs() < 1e-6);
        // a column of length 3 and prior width 1: 3² − (3·3)²/(3² + 1) = 0.9 remains of 9
        assert!((remaining(&[unit(0) * 3.0], vec![unit(2)], &gap) - 16.9).abs() < 1e-6);
        // the same column twice gives the same result
        assert!((remaining(&[], vec![unit(2), unit(2)], &gap) - 25.0).abs() < 1e-6);
    }
}
