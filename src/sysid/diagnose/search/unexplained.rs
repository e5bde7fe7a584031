//! Unexplained share of each channel.

use crate::compare::ChannelId;
use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::local::CHANNELS;
use crate::diagnose::search::round::Round;
use crate::weak_form::windows::{self, Series};
use greylag_num::statistics::mean;

/// Variance of a channel beyond its noise, and the variance of that noise, both in squared units of the channel.
struct Measured {
    variance: f64,
    noise: f64,
}

/// Measured variances of every channel in the flights of `first`; `None` where it is not measured.
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

fn mean_square(residual: &[Column], channel: usize) -> f64 {
    let finite = residual.iter().flat_map(|c| c[channel].iter()).filter(|x| x.is_finite());
    mean(&finite.map(|x| x * x).collect::<Vec<f64>>())
}

/// Share of each channel's variance beyond noise that remains in `residual`, a column for each flight, under the
/// model of `first`; NaN where the flights do not measure the channel.
pub fn unexplained(first: &Round, residual: &[Column]) -> [f64; CHANNELS] {
    let measured = measured(first);
    std::array::from_fn(|k| match &measured[k] {
        Some(Measured { variance, noise }) => {
            ((mean_square(residual, k) - noise) / variance).max(0.0)
        }
        None => f64::NAN,
    })
}

/// Share of each channel's variance beyond noise by which the mean square residual falls from `before` to `after`;
/// negative if it rises, 0 where the flights do not measure the channel.
pub fn explained(first: &Round, before: &[Column], after: &[Column]) -> [f64; CHANNELS] {
    let measured = measured(first);
    std::array::from_fn(|k| match &measured[k] {
        Some(Measured { variance, .. }) => {
            (mean_square(before, k) - mean_square(after, k)) / variance
        }
        None => 0.0,
    })
}
