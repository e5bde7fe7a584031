//! Separation of two candidate effects by flights, after everything else has been refitted.

use nalgebra::{DMatrix, DVector};

use crate::weak_form::prepared::Prepared;
use crate::weak_form::windows::{channels, columns};
use greylag_model::GreyBox;

/// Number of channels used: D, L, Y, l, m, n.
const CHANNELS: usize = 6;
/// Ridge parameter of a free column relative to its squared norm, so that a system with equal columns remains solvable.
const RIDGE: f64 = 1e-9;
/// Prior width of a sensor's constant error in a channel, in standard deviations of a window's noise.
const BIAS_WIDTH: f64 = 100.0;

/// Squared difference in predictions due to an effect that remains after a refit, in noise variances, the unit of evidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// Squared difference after the coefficients are refitted: whether the effect is detectable at all.
    pub visible: f64,
    /// Squared difference after the other effect is fitted in its place as well.
    pub apart: f64,
}

/// Separation, by `flight`, of the effect that `truth` has from another effect; `base` lacks both.
///
/// `others` holds the ways in which the other effect may be fitted. Each is a set of models whose differences from `base`
/// are scaled freely.
///
/// The coefficients of `base` are refitted within their prior widths, and so are constant errors in every channel.
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

/// Standard deviation of each channel's noise; infinite for one that is not measured.
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

/// Measured less predicted in standard deviations of noise, channel after channel; 0 where not known.
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

/// Columns of all parameters that are refitted, each times its prior width.
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

/// Squared length of `gap` after projection onto `prior` (each with a unit pseudo-observation) and `free` has been
/// subtracted.
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
        // a column of length 3 and prior width 1: 3² − (3·3)²/(3² + 1) = 0.9 of the 9 is left
        assert!((remaining(&[unit(0) * 3.0], vec![unit(2)], &gap) - 16.9).abs() < 1e-6);
        // the same column twice does no harm
        assert!((remaining(&[], vec![unit(2), unit(2)], &gap) - 25.0).abs() < 1e-6);
    }
}
