//! Mean squares of a channel: measured values, residuals and noise.

use super::bins::Residual;

/// The unexplained fraction is defined only if the channel's variance beyond noise is more than this fraction of its total
/// variance.
const EXCITED: f64 = 0.05;

/// Mean squares of a channel, in its unit squared.
pub struct Power {
    /// Variance of the measured channel.
    pub measured: f64,
    /// Mean square of the residual.
    pub residual: f64,
    /// Variance of the sensor noise.
    pub noise: f64,
    /// Fraction of the mean square residual that is due to the mean residual, 0 to 1.
    pub offset: f64,
}

impl Power {
    /// Mean squares of the channel with `residuals` and the noise variance `noise`.
    pub fn of(residuals: &[Residual], noise: f64) -> Power {
        let count = residuals.len() as f64;
        let mean = residuals.iter().map(|r| r.measured).sum::<f64>() / count;
        let residual = residuals.iter().map(|r| r.value.powi(2)).sum::<f64>() / count;
        let offset = residuals.iter().map(|r| r.value).sum::<f64>() / count;
        Power {
            measured: residuals.iter().map(|r| (r.measured - mean).powi(2)).sum::<f64>() / count,
            residual,
            noise,
            offset: offset * offset / residual,
        }
    }

    /// Unexplained fraction of the channel's variance beyond noise; NaN if the variance hardly exceeds the noise.
    pub fn unexplained(&self) -> f64 {
        let signal = self.measured - self.noise;
        if signal > EXCITED * self.measured {
            (self.residual - self.noise).max(0.0) / signal
        } else {
            f64::NAN
        }
    }
}
