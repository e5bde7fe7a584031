//! The runs of a model or forecast, and their errors. x_c is the scale by which the error of each state is divided.

use super::free_run::{DIVERGENCE_BOUND, error, scaled};
use super::result::{GrowthPoint, HorizonScore, StateScore};
use greylag_num::statistics::{mean, quantile};
use greylag_physics::State;

/// Measured and predicted state of a run at one time; `None` once the run has diverged.
pub(super) type Look = Option<[[f64; 8]; 2]>;

/// One run without a judgement of its error.
#[derive(Clone, Debug)]
pub(super) struct Ahead {
    /// The state in which the run starts.
    pub(super) from: [f64; 8],
    /// Measured and predicted state at each horizon that the flight reaches.
    pub(super) pairs: Vec<[[f64; 8]; 2]>,
    /// Scaled error (dimensionless) at the same horizons of the run without the hold that [`End::Far`](super::free_run::End::Far)
    /// describes. Infinite or NaN where the run has left all bounds.
    pub(super) unheld: Vec<f64>,
}

/// All free runs of a model over all flights.
pub struct Runs {
    /// Times at which the errors are evaluated, s after the start of a run, ascending.
    pub(super) times: Vec<f64>,
    /// For each run: its states at `times`, up to the end of its segment (stretch of a flight without gaps).
    pub(super) runs: Vec<Vec<Look>>,
    pub(super) scale: [f64; 8],
}

impl Runs {
    /// Combines `runs`, which are evaluated at the `times` (s). `scale` is the scale x_c of each state.
    pub(super) fn new(times: Vec<f64>, runs: Vec<Vec<Look>>, scale: [f64; 8]) -> Runs {
        Runs { times, runs, scale }
    }

    fn at(&self, time: f64) -> Vec<Look> {
        let place = self.times.iter().position(|t| (t - time).abs() < 1e-9);
        place.map_or(Vec::new(), |k| self.runs.iter().filter_map(|r| r.get(k).copied()).collect())
    }

    /// Scaled errors of `looks`, the states of all runs at one time. The error of a diverged run is [`DIVERGENCE_BOUND`].
    fn errors(&self, looks: &[Look]) -> Vec<f64> {
        let one = |look: &Look| match look {
            Some([measured, predicted]) => scaled(&error(measured, predicted), &self.scale),
            None => DIVERGENCE_BOUND,
        };
        looks.iter().map(one).collect()
    }

    /// Scaled error of each run at `horizon_s` (s), one of the evaluated times. The error of a diverged run is
    /// [`DIVERGENCE_BOUND`].
    pub fn scaled_errors(&self, horizon_s: f64) -> Vec<f64> {
        self.errors(&self.at(horizon_s))
    }

    /// The errors over all runs at `horizon_s` (s), one of the evaluated times.
    pub fn score(&self, horizon_s: f64) -> HorizonScore {
        let looks = self.at(horizon_s);
        let diverged = looks.iter().filter(|l| l.is_none()).count();
        let whole: Vec<[[f64; 8]; 2]> = looks.iter().flatten().copied().collect();
        HorizonScore {
            horizon_s,
            runs: looks.len(),
            diverged,
            divergence_rate: diverged as f64 / looks.len() as f64,
            rmse_scaled: root_mean_square(&self.errors(&looks)),
            states: (0..8).map(|k| self.state_score(k, &whole)).collect(),
        }
    }

    /// The growth of the error with time.
    pub fn growth(&self) -> Vec<GrowthPoint> {
        let point = |&time_s: &f64| {
            let looks = self.at(time_s);
            let errors = self.errors(&looks);
            GrowthPoint {
                time_s,
                runs: looks.len(),
                diverged: looks.iter().filter(|l| l.is_none()).count(),
                rmse_scaled: root_mean_square(&errors),
                median_scaled: quantile(&errors, 0.5),
                p90_scaled: quantile(&errors, 0.9),
            }
        };
        self.times.iter().map(point).filter(|p| p.runs > 0).collect()
    }

    /// RMSE, R², Theil's U and Theil's proportions for state number `k`.
    fn state_score(&self, k: usize, runs: &[[[f64; 8]; 2]]) -> StateScore {
        let measured: Vec<f64> = runs.iter().map(|r| r[0][k]).collect();
        // the error is wrapped, so that a measured roll of 179° and a predicted one of −179° differ by 2°
        let predicted: Vec<f64> = runs.iter().map(|r| r[0][k] + error(&r[0], &r[1])[k]).collect();
        let errors: Vec<f64> = predicted.iter().zip(&measured).map(|(a, b)| a - b).collect();
        let rmse = root_mean_square(&errors);
        let (mean_a, mean_b) = (mean(&predicted), mean(&measured));
        let (sd_a, sd_b) = (deviation(&predicted, mean_a), deviation(&measured, mean_b));
        let bias = (mean_a - mean_b).powi(2) / (rmse * rmse);
        let variance = (sd_a - sd_b).powi(2) / (rmse * rmse);
        StateScore {
            state: State::NAMES[k],
            rmse,
            rmse_scaled: rmse / self.scale[k],
            r2: 1.0 - (rmse / sd_b).powi(2),
            theil_u: rmse / (root_mean_square(&predicted) + root_mean_square(&measured)),
            bias_share: bias,
            variance_share: variance,
            covariance_share: at_least_zero(1.0 - bias - variance),
        }
    }
}

/// Returns `x`, or 0 if `x` is negative. A NaN stays NaN, which `f64::max` would replace by 0.
fn at_least_zero(x: f64) -> f64 {
    if x < 0.0 { 0.0 } else { x }
}

fn root_mean_square(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
}

fn deviation(x: &[f64], mean: f64) -> f64 {
    (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn theils_shares_of_known_errors() {
        let runs = |f: fn(f64) -> f64| Runs {
            times: vec![1.0],
            scale: [1.0; 8],
            runs: [-0.4, -0.1, 0.2, 0.3].map(|x: f64| vec![Some([[x; 8], [f(x); 8]])]).to_vec(),
        };
        let offset = runs(|x| x + 0.1).score(1.0);
        let s = &offset.states[1];
        assert!((s.rmse - 0.1).abs() < 1e-12 && (s.bias_share - 1.0).abs() < 1e-9);
        // the prediction is twice the measured value: the RMSE equals the RMS of the measured values, so U = 1/(2 + 1)
        let doubled = runs(|x| 2.0 * x).score(1.0);
        let s = &doubled.states[1];
        assert!((s.theil_u - 1.0 / 3.0).abs() < 1e-12 && (s.variance_share - 1.0).abs() < 1e-9);
        assert_eq!(offset.divergence_rate, 0.0);
    }

    #[test]
    fn a_diverged_run_counts_with_the_bound() {
        let exact = Some([[0.1; 8]; 2]);
        let runs = Runs { times: vec![1.0], scale: [1.0; 8], runs: vec![vec![exact], vec![None]] };
        let score = runs.score(1.0);
        assert_eq!((score.runs, score.diverged, score.divergence_rate), (2, 1, 0.5));
        assert!((score.rmse_scaled - DIVERGENCE_BOUND / 2_f64.sqrt()).abs() < 1e-12);
        assert_eq!(score.states[2].rmse, 0.0);
        // Theil's proportions of a zero error are not defined
        let s = &score.states[2];
        assert!(s.bias_share.is_nan() && s.variance_share.is_nan() && s.covariance_share.is_nan());
        // a roll of 179° predicted as −179° has an error of 2°
        let e = error(&[179_f64.to_radians(); 8], &[-179_f64.to_radians(); 8]);
        assert!((e[0] - 2_f64.to_radians()).abs() < 1e-9);
    }
}
