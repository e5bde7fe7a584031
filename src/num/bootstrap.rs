//! Intervals of statistics from resampling.

use rand::RngExt;

use super::statistics::quantile;
use super::stream;

/// Resamples of an interval.
const RESAMPLES: usize = 2000;

/// The 95 % percentile interval of `statistic` over `samples`, resampled with replacement from `seed`
/// (Efron 1979; section VI of \[GSFM26\]); NaN for no samples.
pub fn interval(samples: &[f64], seed: u64, statistic: impl Fn(&[f64]) -> f64) -> [f64; 2] {
    if samples.is_empty() {
        return [f64::NAN; 2];
    }
    let mut random = stream::stream(seed, &[]);
    let mut drawn = vec![0.0; samples.len()];
    let values: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            drawn.iter_mut().for_each(|x| *x = samples[random.random_range(0..samples.len())]);
            statistic(&drawn)
        })
        .collect();
    [quantile(&values, 0.025), quantile(&values, 0.975)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::statistics::mean;
    use rand_distr::{Distribution, StandardNormal};

    /// The interval of a mean covers it about as often as it says.
    #[test]
    fn intervals_cover_the_mean() {
        let mut random = stream::stream(5, &[]);
        let covered = (0..200)
            .filter(|&k| {
                let samples: Vec<f64> =
                    (0..50).map(|_| StandardNormal.sample(&mut random)).collect();
                let [low, high] = interval(&samples, k, mean);
                low <= 0.0 && 0.0 <= high
            })
            .count();
        // 95 % less the bootstrap's own 1–2 % at 50 samples; a binomial deviation is 1.5 %
        assert!((178..=199).contains(&covered), "{covered} of 200");
        let all = interval(&[2.0; 7], 1, mean);
        assert_eq!(all, [2.0, 2.0]);
        assert!(interval(&[], 1, mean)[0].is_nan());
    }
}
