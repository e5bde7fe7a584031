//! Statistics of samples: mean, quantiles and the interquartile mean.

/// The arithmetic mean; NaN for no samples.
pub fn mean(samples: &[f64]) -> f64 {
    samples.iter().sum::<f64>() / samples.len() as f64
}

/// The quantile `q` in 0..=1, linear between order statistics; NaN for no samples.
pub fn quantile(samples: &[f64], q: f64) -> f64 {
    if samples.is_empty() {
        return f64::NAN;
    }
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = q.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let (low, part) = (place.floor() as usize, place.fract());
    let high = (low + 1).min(sorted.len() - 1);
    sorted[low] * (1.0 - part) + sorted[high] * part
}

/// The mean of the middle half of the samples (Agarwal et al. 2021), as `scipy.stats.trim_mean`
/// with a quarter cut from each end; NaN for no samples.
pub fn interquartile_mean(samples: &[f64]) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let cut = sorted.len() / 4;
    mean(&sorted[cut..sorted.len() - cut])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_known_samples() {
        let samples = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(mean(&samples), 2.5);
        assert_eq!(quantile(&samples, 0.5), 2.5);
        assert_eq!(quantile(&samples, 0.0), 1.0);
        assert_eq!(quantile(&samples, 1.0), 4.0);
        assert_eq!(interquartile_mean(&samples), 2.5);
        assert_eq!(interquartile_mean(&[0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 900.0]), 1.0);
        assert!(quantile(&[], 0.5).is_nan());
    }
}
