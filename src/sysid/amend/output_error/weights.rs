//! Weights of the output-error fit.
//!
//! The fit simulates shots: short stretches of the flights, each from its own initial state. The residuals of a shot are the
//! differences between the recorded and the simulated states. States and shots have separate weights.

use super::Search;
use greylag_num::statistics::{correlation_length, quantile};

/// Smallest standard deviations of residuals, in the units of the state. They cover errors that are present without noise, due
/// to discrete model steps and interpolated deflections.
const FLOOR: [f64; 8] = [5e-4, 5e-4, 0.01, 2e-3, 2e-3, 2e-3, 5e-4, 5e-4];
/// A shot is down-weighted if its weighted mean square residual exceeds the median of all shots by this factor.
const OUTLYING: f64 = 6.0;

impl Search<'_> {
    /// Sets the weights from the present residuals. The weight of a state is the inverse of its residual variance, divided by a
    /// common correlation length. Outlying shots get lower weights.
    ///
    /// With a separate correlation length for each state, the iteration would not converge to useful weights. A state that
    /// drifts has a longer correlation length and therefore a lower weight. It then drifts more, until the fit ignores this
    /// state.
    pub(super) fn reweigh(&mut self) {
        let residuals = &self.residuals;
        let square = |r: &[[f64; 8]], k: usize| r.iter().map(|x| x[k] * x[k]).sum::<f64>();
        let together = common_length(residuals);
        for (k, floor) in FLOOR.iter().enumerate() {
            let (mut sum, mut count) = (0.0, 0.0);
            for (shot, r) in self.shots.iter().zip(residuals) {
                sum += shot.weight * square(r, k);
                count += shot.weight * r.len() as f64;
            }
            let variance = (sum / count).max(floor.powi(2));
            self.weights.output[k] = 1.0 / (variance * together);
        }
        let mean = |r: &Vec<[f64; 8]>| {
            let w = &self.weights.output;
            (0..8).map(|k| w[k] * square(r, k)).sum::<f64>() / r.len() as f64
        };
        let means: Vec<f64> = residuals.iter().map(mean).collect();
        let usual = OUTLYING * quantile(&means, 0.5);
        for (shot, mean) in self.shots.iter_mut().zip(means) {
            shot.weight = (usual / mean).min(1.0);
        }
    }
}

/// Geometric mean of the states' correlation lengths, in samples.
fn common_length(residuals: &[Vec<[f64; 8]>]) -> f64 {
    let of_state = |k: usize| -> Vec<Vec<f64>> {
        residuals.iter().map(|r| r.iter().map(|x| x[k]).collect()).collect()
    };
    let logarithms = (0..8).map(|k| correlation_length(&of_state(k)).ln());
    (logarithms.sum::<f64>() / 8.0).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_state_that_drifts_makes_all_count_less() {
        let mut random = greylag_num::stream::stream(5, &[]);
        let mut white = || rand::RngExt::random_range(&mut random, -1.0..1.0);
        let shots: Vec<Vec<[f64; 8]>> =
            (0..20).map(|_| (0..200).map(|_| std::array::from_fn(|_| white())).collect()).collect();
        let alone = common_length(&shots);
        assert!((alone - 1.0).abs() < 0.5, "{alone}");
        let mut drifting = shots;
        for shot in &mut drifting {
            for (k, row) in shot.iter_mut().enumerate() {
                row[2] = k as f64;
            }
        }
        // the correlation length of this state is several hundred samples; the geometric mean of eight takes the eighth root
        let all = common_length(&drifting);
        assert!((1.3..3.0).contains(&all), "{all}");
    }
}
