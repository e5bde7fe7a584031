//! How much of each channel is left unexplained.

use crate::num::statistics::mean;
use crate::sysid::compare::ChannelId;
use crate::sysid::diagnose::regression::gather::Column;
use crate::sysid::diagnose::regression::local::CHANNELS;
use crate::sysid::diagnose::search::round::Round;
use crate::sysid::weak_form::windows::{self, Series};

/// Share of each channel's variance beyond noise that `residual`, a column a flight, leaves unexplained under
/// the model of `first`; NaN where the flights do not measure the channel.
pub fn unexplained(first: &Round, residual: &[Column]) -> [f64; CHANNELS] {
    let series: Vec<Vec<Series>> =
        first.flights.iter().map(|f| windows::channels(&first.model, &f.measured)).collect();
    std::array::from_fn(|k| {
        let own: Vec<&Series> =
            series.iter().flatten().filter(|s| s.channel == ChannelId::ALL[k]).collect();
        let measured: Vec<f64> =
            own.iter().flat_map(|s| s.measured.iter().copied()).filter(|x| x.is_finite()).collect();
        if measured.is_empty() {
            return f64::NAN;
        }
        let noise = mean(&own.iter().map(|s| s.noise_variance).collect::<Vec<_>>());
        let middle = mean(&measured);
        let deviations: Vec<f64> = measured.iter().map(|x| (x - middle).powi(2)).collect();
        let left = residual.iter().flat_map(|c| c[k].iter()).filter(|x| x.is_finite());
        let squares: Vec<f64> = left.map(|x| x * x).collect();
        ((mean(&squares) - noise) / (mean(&deviations) - noise).max(1e-12)).max(0.0)
    })
}
