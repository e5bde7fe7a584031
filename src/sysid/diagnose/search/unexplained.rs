//! Explained and unexplained fractions of the variance of each channel (component of force or moment). The fractions are
//! relative to the variance beyond noise, which is the variance less that due to sensor noise.

use crate::compare::ChannelId;
use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::local::CHANNELS;
use crate::diagnose::search::round::Round;
use crate::weak_form::windows::{self, Series};
use greylag_num::statistics::mean;

/// Variance of a channel beyond its noise, and variance of the noise, in the channel's unit squared.
struct Measured {
    variance: f64,
    noise: f64,
}

/// Variances of every channel in the flights of `first`, the first round of the search, before any effect was added. `None`
/// for a channel that is not measured.
fn measured(first: &Round) -> [Option<Measured>; CHANNELS] {
    let series: Vec<Vec<Series>> =
        first.flights.iter().map(|f| windows::channels(&first.model, &f.measured)).collect();
    std::array::from_fn(|k| {
        let own: Vec<&Series> =
            series.iter().flatten().filter(|s| s.channel == ChannelId::ALL[k]).collect();
        let measured: Vec<f64> =
            own.iter().flat_map(|s| s.measured.iter().copied()).filter(|x| x.is_finite()).collect();
        if measured.is_empty() {
            return None;
        }
        let noise = mean(&own.iter().map(|s| s.noise_variance).collect::<Vec<_>>());
        let middle = mean(&measured);
        let deviations: Vec<f64> = measured.iter().map(|x| (x - middle).powi(2)).collect();
        Some(Measured { variance: (mean(&deviations) - noise).max(1e-12), noise })
    })
}

/// Mean square of the finite values of `residual` in `channel`. An empty column means zeros. NaN if no value is finite,
/// for example because the model predicts NaN.
fn mean_square(residual: &[Column], channel: usize) -> f64 {
    if residual.iter().all(|c| c[channel].is_empty()) {
        return 0.0;
    }
    let finite = residual.iter().flat_map(|c| c[channel].iter()).filter(|x| x.is_finite());
    mean(&finite.map(|x| x * x).collect::<Vec<f64>>())
}

/// Excess of the mean square `left` over the noise variance `noise`, as a fraction of `variance`; at least 0. NaN if
/// `left` is NaN (`f64::max` would return 0).
fn share(left: f64, noise: f64, variance: f64) -> f64 {
    let share = (left - noise) / variance;
    if share < 0.0 { 0.0 } else { share }
}

/// Fraction of each channel's variance beyond noise that remains in `residual`, which has one entry for each flight. The
/// variance of the noise is computed with the model of `first`. NaN if the flights do not measure the channel, or if the
/// model predicts only NaN in it.
pub fn unexplained(first: &Round, residual: &[Column]) -> [f64; CHANNELS] {
    let measured = measured(first);
    std::array::from_fn(|k| match &measured[k] {
        Some(Measured { variance, noise }) => share(mean_square(residual, k), *noise, *variance),
        None => f64::NAN,
    })
}

/// Decrease of the mean square residual from `before` to `after`, as a fraction of each channel's variance beyond noise.
/// The decrease is negative if the residual increases, and 0 if the flights do not measure the channel.
pub fn explained(first: &Round, before: &[Column], after: &[Column]) -> [f64; CHANNELS] {
    let measured = measured(first);
    std::array::from_fn(|k| match &measured[k] {
        Some(Measured { variance, .. }) => {
            (mean_square(before, k) - mean_square(after, k)) / variance
        }
        None => 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_without_a_prediction_is_not_explained() {
        let column = |values: &[f64]| {
            let mut column = Column::default();
            column[1] = values.to_vec();
            vec![column]
        };
        let left = |values: &[f64]| share(mean_square(&column(values), 1), 1.0, 10.0);
        assert!(left(&[f64::NAN, f64::NAN]).is_nan());
        assert_eq!(left(&[]), 0.0);
        assert_eq!(left(&[0.5, f64::NAN]), 0.0);
        assert_eq!(left(&[4.0, -4.0]), 1.5);
    }
}
