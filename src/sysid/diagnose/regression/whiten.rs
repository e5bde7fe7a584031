//! Autoregressive whitening of the residual of a channel.

/// Variance of white noise that is added to the autocovariance at lag 0, as a fraction of it. No frequency then counts as
/// free of noise.
const FLOOR: f64 = 1e-3;

/// Linear predictors of a value from the values before it: one predictor for each order from 0 to the largest.
#[derive(Clone, Debug, PartialEq)]
pub struct Whitener {
    /// `predictors[k]` has the weights of the last k values, the most recent one first.
    predictors: Vec<Vec<f64>>,
    /// Standard deviation of each predictor's prediction error.
    deviations: Vec<f64>,
}

impl Whitener {
    /// Fits predictors of all orders up to `order` to `runs` by Levinson's recursion. Each run is a sequence of adjacent
    /// windows.
    pub fn fit(runs: &[Vec<f64>], order: usize) -> Whitener {
        let mut covariance: Vec<f64> = (0..=order).map(|lag| autocovariance(runs, lag)).collect();
        if !(covariance[0].is_finite() && covariance[0] > 0.0) {
            return Whitener { predictors: vec![Vec::new()], deviations: vec![1.0] };
        }
        covariance[0] *= 1.0 + FLOOR;
        let mut variance = covariance[0];
        let mut predictor: Vec<f64> = Vec::new();
        let mut fitted =
            Whitener { predictors: vec![Vec::new()], deviations: vec![variance.sqrt()] };
        for k in 0..order {
            let known: f64 = predictor.iter().enumerate().map(|(j, a)| a * covariance[k - j]).sum();
            let reflection = (covariance[k + 1] - known) / variance;
            let before = predictor.clone();
            for (j, a) in predictor.iter_mut().enumerate() {
                *a -= reflection * before[k - 1 - j];
            }
            predictor.push(reflection);
            variance *= 1.0 - reflection * reflection;
            fitted.predictors.push(predictor.clone());
            fitted.deviations.push(variance.max(0.0).sqrt());
        }
        fitted
    }

    /// Returns the prediction errors of `run` divided by their standard deviation. The first values are predicted with lower
    /// orders.
    pub fn apply(&self, run: &[f64]) -> Vec<f64> {
        let order = self.predictors.len() - 1;
        (0..run.len())
            .map(|k| {
                let of = &self.predictors[k.min(order)];
                let known: f64 = of.iter().enumerate().map(|(j, a)| a * run[k - 1 - j]).sum();
                (run[k] - known) / self.deviations[k.min(order)]
            })
            .collect()
    }

    /// Adapts the whitener to noise whose standard deviation is `factor` times as large.
    pub fn scaled(mut self, factor: f64) -> Whitener {
        self.deviations.iter_mut().for_each(|d| *d *= factor);
        self
    }
}

/// Sum of x(k) x(k + lag) within each run, divided by the number of all values. The divisor is the same for every lag, which
/// keeps the autocovariance sequence positive definite.
fn autocovariance(runs: &[Vec<f64>], lag: usize) -> f64 {
    let count: usize = runs.iter().map(Vec::len).sum();
    let of = |run: &Vec<f64>| run.iter().zip(run.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
    runs.iter().map(of).sum::<f64>() / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_num::stream::stream;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn a_moving_average_becomes_white_with_unit_variance() {
        let mut random = stream(3, &[]);
        let noise: Vec<f64> = (0..20_001).map(|_| StandardNormal.sample(&mut random)).collect();
        // windows that overlap by half have correlated noise, as the values of this moving average have
        let run: Vec<f64> = noise.windows(2).map(|w| 3.0 * (w[1] - 0.6 * w[0])).collect();
        let white = Whitener::fit(std::slice::from_ref(&run), 8).apply(&run);
        let runs = [white];
        let [zero, one, two] = [0, 1, 2].map(|lag| autocovariance(&runs, lag));
        // 20 000 samples: the standard deviation of a correlation is 0.007
        assert!((zero - 1.0).abs() < 0.04, "{zero}");
        assert!(one.abs() < 0.03 && two.abs() < 0.03, "{one} {two}");
    }
}
