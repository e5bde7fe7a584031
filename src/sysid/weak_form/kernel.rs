//! Kernel of the weak form. The weak form multiplies the equations of motion by a smooth kernel and integrates by parts, so
//! that measured data need not be differentiated. The kernel is a Hann window.

use std::f64::consts::TAU;

/// Length of the kernel, s (see `docs/explanation/comparison.md`).
pub const KERNEL_S: f64 = 0.37;

/// A Hann window over a number of time steps; it has one more sample than steps.
///
/// The equation ẋ = f is multiplied by the kernel K. Summation by parts then moves the difference from the data to K:
/// Σ K (x₊ − x)/Δt = −Σ K′ x. The sums are exact for discrete steps. The residual of an exact model is therefore zero if the
/// model has the same integrator as the simulated flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// Weights K of the steps, which sum to 1.
    pub step: Vec<f64>,
    /// Weights K of the samples (mean of the two adjacent steps), which sum to 1.
    pub sample: Vec<f64>,
    /// Weights −K′ of the samples, 1/s: Σ `slope` x is the smoothed rate of x.
    pub slope: Vec<f64>,
}

impl Kernel {
    /// Kernel of length [`KERNEL_S`] for a sampling interval of `dt` (s), at least two steps long.
    pub fn hann(dt: f64) -> Kernel {
        let steps = ((KERNEL_S / dt).round() as usize).max(2);
        let raw: Vec<f64> =
            (0..steps).map(|j| 1.0 - (TAU * (j as f64 + 0.5) / steps as f64).cos()).collect();
        let sum: f64 = raw.iter().sum();
        let step: Vec<f64> = raw.iter().map(|w| w / sum).collect();
        let around = |i: usize| {
            let before = i.checked_sub(1).map_or(0.0, |j| step[j]);
            (before, step.get(i).copied().unwrap_or(0.0))
        };
        let sample = (0..=steps).map(|i| 0.5 * (around(i).0 + around(i).1)).collect();
        let slope = (0..=steps).map(|i| (around(i).0 - around(i).1) / dt).collect();
        Kernel { step, sample, slope }
    }

    /// Length of the kernel in time steps.
    pub fn steps(&self) -> usize {
        self.step.len()
    }

    /// Number of time steps between two windows: half a kernel, rounded up.
    pub fn stride(&self) -> usize {
        self.steps().div_ceil(2)
    }
}

/// Weighted sum Σ weights · values.
pub fn weigh(weights: &[f64], values: impl Iterator<Item = f64>) -> f64 {
    weights.iter().zip(values).map(|(w, x)| w * x).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_of_a_parabola_are_exact_without_differences_of_data() {
        let kernel = Kernel::hann(0.01);
        let x = |i: usize| 3.0 + 2.0 * (i as f64 * 0.01) + 5.0 * (i as f64 * 0.01).powi(2);
        let rate = weigh(&kernel.slope, (0..=kernel.steps()).map(x));
        // the kernel is symmetric, so this is the rate in the middle: 2 + 10 t, t = 37 · 0.005
        assert!((rate - (2.0 + 10.0 * 0.185)).abs() < 1e-9, "{rate}");
        assert!((kernel.sample.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(kernel.steps(), 37);
    }
}
