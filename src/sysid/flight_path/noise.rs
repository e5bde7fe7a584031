//! Estimators of noise: white part of a signal, robust root mean square of residuals, correlation of residuals in time.

use greylag_num::statistics::quantile;

/// Smallest number of values for an estimate.
const FEWEST: usize = 8;

/// Standard deviation of the white part of `samples`, in their unit. NaN for too few samples; missing samples are skipped.
///
/// The estimate uses fourth differences, in which a smooth signal vanishes.
pub fn white(samples: impl Iterator<Item = f64>) -> f64 {
    let x: Vec<f64> = samples.filter(|x| x.is_finite()).collect();
    let differences: Vec<f64> =
        x.windows(5).map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs()).collect();
    if differences.len() < FEWEST {
        return f64::NAN;
    }
    // white noise of unit variance has fourth differences of variance 70
    let gain = 70.0_f64.sqrt();
    let median = 1.4826 * quantile(&differences, 0.5) / gain;
    let mean_square = differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64;
    // coarsely quantised data has a median of zero
    if median > 0.0 { median } else { mean_square.sqrt() / gain }
}

/// Standard deviation of the white part of signals that also hold a random walk, as vanes in gusts, in their unit. NaN if the
/// signals show none. `tracks` holds the samples of each track; missing samples are skipped.
///
/// Second differences of a random walk have no correlation over two samples, and those of a smooth signal vanish. White noise of
/// variance R gives them the autocovariance R at this lag. Fourth differences count the steps of the walk as noise.
pub fn white_beside_walk(tracks: impl Iterator<Item = Vec<f64>>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for track in tracks {
        let x: Vec<f64> = track.into_iter().filter(|x| x.is_finite()).collect();
        let bends: Vec<f64> = x.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]).collect();
        for pair in bends.windows(3) {
            sum += pair[0] * pair[2];
            count += 1.0;
        }
    }
    if count < FEWEST as f64 { f64::NAN } else { (sum / count).sqrt() }
}

/// Root mean square of `residuals`, with outliers limited to four standard deviations estimated from the median. NaN for too
/// few residuals. Reorders the slice.
pub fn level(residuals: &mut [f64]) -> f64 {
    if residuals.len() < FEWEST {
        return f64::NAN;
    }
    let middle = residuals.len() / 2;
    let size = |a: &f64, b: &f64| a.abs().total_cmp(&b.abs());
    let median = residuals.select_nth_unstable_by(middle, size).1.abs();
    let bound = if median > 0.0 { 4.0 * 1.4826 * median } else { f64::INFINITY };
    let sum: f64 = residuals.iter().map(|r| r.abs().min(bound).powi(2)).sum();
    (sum / residuals.len() as f64).sqrt()
}

/// Ratio of two standard deviations of the means over blocks of `block` values: that of `residuals`, and that of white noise
/// with the same variance. The result is 1 if the ratio is not significantly above 1.
pub fn colour(residuals: &[f64], block: usize) -> f64 {
    let count = residuals.len() / block.max(1);
    if block < 2 || count < FEWEST {
        return 1.0;
    }
    let variance = residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64;
    let of_means = residuals
        .chunks_exact(block)
        .map(|b| (b.iter().sum::<f64>() / block as f64).powi(2))
        .sum::<f64>()
        / count as f64;
    let ratio = of_means * block as f64 / variance;
    // for white noise, the ratio of variances has the mean 1 and the standard deviation √(2 / count)
    let chance = 1.0 + 3.0 * (2.0 / count as f64).sqrt();
    if ratio > chance { ratio.sqrt() } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_num::stream::stream;
    use rand_distr::{Distribution, StandardNormal};

    fn noise(n: usize) -> Vec<f64> {
        let mut random = stream(1, &[]);
        (0..n).map(|_| StandardNormal.sample(&mut random)).collect()
    }

    #[test]
    fn levels_of_known_noise_on_a_smooth_signal() {
        let noise = noise(4000);
        let signal = |k: usize| 3.0 * (k as f64 * 0.05).sin();
        let x = noise.iter().enumerate().map(|(k, n)| signal(k) + 0.02 * n);
        // the median of 4000 correlated values has a standard deviation of about 3 %
        assert!((white(x) / 0.02 - 1.0).abs() < 0.06);
        let mut noise = noise;
        assert!((level(&mut noise) - 1.0).abs() < 0.04);
    }

    #[test]
    fn white_noise_beside_a_random_walk_is_told_from_its_steps() {
        let all = noise(160_000);
        let (noise, steps) = all.split_at(80_000);
        let mut walk = 0.0;
        let x: Vec<f64> = (0..80_000)
            .map(|k| {
                walk += 0.02 * steps[k];
                walk + 0.02 * noise[k] + (k as f64 * 0.05).sin()
            })
            .collect();
        assert!(white(x.iter().copied()) > 1.1 * 0.02);
        // by Bartlett's formula the autocovariance has a standard deviation of 4 %, its root half of that
        let found = white_beside_walk([x].into_iter()) / 0.02;
        assert!((found - 1.0).abs() < 0.06, "{found}");
    }

    #[test]
    fn colour_tells_slow_noise_from_white() {
        let noise = noise(8000);
        assert_eq!(colour(&noise, 100), 1.0);
        let mut slow = 0.0;
        let slow: Vec<f64> = noise
            .iter()
            .map(|n| {
                slow = 0.9 * slow + n;
                slow
            })
            .collect();
        // for a first-order process, the ratio of variances is (1 + 0.9) / (1 − 0.9) = 19, reduced by the ends
        // of the blocks
        let found = colour(&slow, 100);
        assert!((3.4..4.8).contains(&found), "{found}");
    }
}
