//! Statistics of samples: mean, quantiles, interquartile mean and correlation length.

/// The arithmetic mean. NaN if there are no samples.
pub fn mean(samples: &[f64]) -> f64 {
    samples.iter().sum::<f64>() / samples.len() as f64
}

/// The quantile `q` (0..=1), linear between order statistics. NaN if there are no samples.
pub fn quantile(samples: &[f64], q: f64) -> f64 {
    if samples.is_empty() {
        return f64::NAN;
    }
    let place = q.clamp(0.0, 1.0) * (samples.len() - 1) as f64;
    let (low, part) = (place.floor() as usize, place.fract());
    // only two order statistics are needed, which takes less time than sorting all samples
    let mut parted = samples.to_vec();
    let (_, below, rest) = parted.select_nth_unstable_by(low, f64::total_cmp);
    let (below, above) = (*below, rest.iter().copied().min_by(f64::total_cmp));
    below * (1.0 - part) + above.unwrap_or(below) * part
}

/// The mean of the middle half of the samples (Agarwal et al. 2021), like `scipy.stats.trim_mean` with a quarter cut from
/// each end. NaN if there are no samples.
pub fn interquartile_mean(samples: &[f64]) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let cut = sorted.len() / 4;
    mean(&sorted[cut..sorted.len() - cut])
}

/// Integral correlation length, in samples, of a series with gaps between its `parts`. The length is the sum of the
/// autocorrelation over all positive and negative lags below the lag at which it first falls to 0.05. White noise has the
/// length 1. The series must have zero mean, because its mean is not removed.
pub fn correlation_length(parts: &[Vec<f64>]) -> f64 {
    let mean_product = |lag: usize| {
        let (mut sum, mut n) = (0.0, 0);
        for (part, later) in parts.iter().filter_map(|part| Some((part, part.get(lag..)?))) {
            sum += dot(&part[..later.len()], later);
            n += later.len();
        }
        if n > 0 { sum / n as f64 } else { 0.0 }
    };
    let own = mean_product(0);
    let longest = parts.iter().map(Vec::len).max().unwrap_or(0);
    let correlations = (1..longest).map(|lag| mean_product(lag) / own);
    // a NaN ends the sum, because its comparison is false
    correlations.take_while(|c| *c > 0.05).fold(1.0, |sum, c| sum + 2.0 * c)
}

/// Sum of the products of the elements of `a` and `b`, which have the same length. Four partial sums make use of the processor's
/// vector instructions.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a.zip(b) {
        for (k, sum) in sums.iter_mut().enumerate() {
            *sum += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + rest
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

    #[test]
    fn a_quantile_is_that_of_the_sorted_samples_to_the_bit() {
        use rand::RngExt;
        let mut rng = crate::stream::stream(10, &[]);
        for n in 1..60 {
            let mut samples: Vec<f64> =
                (0..n).map(|_| f64::from(rng.random_range(-9..9i32)) / 3.0).collect();
            if n % 7 == 0 {
                samples.extend([f64::INFINITY, -0.0, 0.0, f64::NAN]);
            }
            let mut sorted = samples.clone();
            sorted.sort_by(f64::total_cmp);
            for q in [0.0, 0.1, 0.25, 0.5, 0.9, 0.99, 1.0] {
                let place = q * (sorted.len() - 1) as f64;
                let low = place.floor() as usize;
                let (a, b) = (sorted[low], sorted[(low + 1).min(sorted.len() - 1)]);
                let right = a * (1.0 - place.fract()) + b * place.fract();
                assert_eq!(quantile(&samples, q).to_bits(), right.to_bits(), "{q} of {samples:?}");
            }
        }
    }

    #[test]
    fn correlation_length_of_a_held_series_is_its_hold() {
        use rand::RngExt;
        let mut rng = crate::stream::stream(9, &[]);
        let white: Vec<f64> = (0..5000).map(|_| rng.random_range(-1.0..1.0)).collect();
        assert!((super::correlation_length(std::slice::from_ref(&white)) - 1.0).abs() < 0.3);
        let held: Vec<f64> = white.iter().flat_map(|x| [*x; 8]).collect();
        let found = super::correlation_length(&[held]);
        assert!((6.0..10.0).contains(&found), "{found}");
    }
}
