//! Mean squares of the measured values, the residuals and the noise of a channel, which is a force, a moment or a rate.

use super::bins::Residual;

/// The unexplained fraction is computed only if the variance of the channel without its noise is more than this fraction of the
/// variance with noise.
const EXCITED: f64 = 0.05;

/// Mean squares of a channel, in its unit squared.
pub struct Power {
    /// Variance of the measured values.
    pub measured: f64,
    /// Mean square of the residual, measured minus predicted.
    pub residual: f64,
    /// Variance of the sensor noise.
    pub noise: f64,
    /// Squared mean of the residual divided by its mean square, 0 to 1.
    pub offset: f64,
}

impl Power {
    /// Mean squares of a channel that has these `residuals` and the noise variance `noise`.
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

    /// Fraction of the channel's variance, without noise, that the model does not explain. NaN if the variance hardly exceeds
    /// that of the noise.
    pub fn unexplained(&self) -> f64 {
        let signal = self.measured - self.noise;
        if signal > EXCITED * self.measured {
            (self.residual - self.noise).max(0.0) / signal
        } else {
            f64::NAN
        }
    }
}
