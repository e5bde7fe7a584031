//! Separation of two candidates: how well a flight distinguishes them after the model's coefficients are refitted. A candidate is
//! an effect (a physical contribution to forces and moments) that a model may lack.
//!
//! A channel is a force or a moment. A window is a short section of the flight over which the channels are averaged.

use nalgebra::{DMatrix, DVector};

use crate::weak_form::prepared::Prepared;
use crate::weak_form::windows::{channels, columns};
use greylag_model::GreyBox;

/// Number of channels: the forces D, L, Y and the moments l, m, n.
const CHANNELS: usize = 6;
/// Ridge parameter of a regressor without a prior, relative to the regressor's squared norm. The normal equations then
/// have a solution even if two regressors are equal.
const RIDGE: f64 = 1e-9;
/// Prior standard deviation of a constant error of a channel, in standard deviations of the noise of one window.
const BIAS_WIDTH: f64 = 100.0;

/// Squared difference between the predictions with and without an effect, summed over all windows and channels, in variances of
/// the noise. The evidence (test statistic) of a diagnosis has the same unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// Difference that remains after the model's coefficients are refitted. It measures how detectable the effect is.
    pub visible: f64,
    /// Difference that remains after the other effect is fitted as well. It measures how well the flight distinguishes the two
    /// effects.
    pub apart: f64,
}

/// Computes how well `flight` shows an effect and distinguishes it from another effect. The model `truth` has the
/// effect; `base` has neither effect.
///
/// `others` lists alternative sets of models that contain the other effect. The regressors of the other effect are the
/// differences between the predictions of a set's models and those of `base`. Their coefficients are free. The set that
/// fits best counts.
///
/// The coefficients of `base` and a constant error in every channel are refitted with their priors.
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

/// Standard deviation of each channel's noise in one window, in the channel's unit. It is infinite if the channel is not
/// measured or its noise is unknown. The channel then has no weight.
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

/// Residuals (measured minus predicted values) in standard deviations of the noise. All windows of the first channel come
/// first, then those of the next channel. The residual of a missing measurement is 0.
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

/// Regressors of all parameters that are refitted, each multiplied by the prior standard deviation of its parameter.
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

/// Fits the regressors `prior` and `free` to `gap` by least squares. The coefficients of `prior` have a prior with zero mean
/// and unit variance. Returns the squared norm of the residual plus the sum of the squared coefficients of `prior`. Zero if the
/// normal equations cannot be solved.
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
        // With a regressor of norm 3 and its prior, 3² − (3·3)²/(3² + 1) = 0.9 remains of 3² = 9, the squared first entry. The
        // second entry adds 4² = 16.
        assert!((remaining(&[unit(0) * 3.0], vec![unit(2)], &gap) - 16.9).abs() < 1e-6);
        // the same regressor twice gives the same result
        assert!((remaining(&[], vec![unit(2), unit(2)], &gap) - 25.0).abs() < 1e-6);
    }
}
