//! Ratios of the error of one way to that of its best rival.

use crate::{CHOSEN_ARX, COMBINED, Errors, FITTED, HOLD, HORIZONS_S, LEAST_SQUARES, WAYS};

/// Places in [`WAYS`] of what the fitted model is compared with: least squares, hold, straight on, and ARX of a chosen order.
pub const RIVALS: [usize; 4] = [LEAST_SQUARES, HOLD, HOLD + 1, CHOSEN_ARX];
/// Places in [`WAYS`] of the combinations without the fitted model: without a model, and of ARX.
const COMBINED_RIVALS: [usize; 2] = [COMBINED + 1, COMBINED + 2];

/// Ratio of the error of one way to that of its best rival.
struct Ratio {
    /// The ratio of the mean errors over the flights held out, dimensionless.
    value: f64,
    /// Standard error of the ratio.
    error: f64,
    /// Number of flights held out.
    flights: usize,
    /// Place of the best rival in [`WAYS`].
    best: usize,
}

/// Prints the ratios of the fitted model, alone and combined, to the best of [`RIVALS`], and of its combination to the best of
/// the others.
pub fn print(errors: &[Errors]) {
    println!("  error / lowest error of the others");
    let ways = [
        ("fitted", FITTED, &RIVALS[..]),
        ("combined", COMBINED, &RIVALS[..]),
        ("  / others combined", COMBINED, &COMBINED_RIVALS[..]),
    ];
    for (name, way, rivals) in ways {
        let [a, b, c] = cells(errors, way, rivals);
        println!("  {name:<20}{a:>38}{b:>38}{c:>38}");
    }
}

/// The ratio of `way` to the best of `rivals` (places in [`WAYS`]) at every horizon, in words; `-` if no flight held out is long
/// enough.
pub fn cells(errors: &[Errors], way: usize, rivals: &[usize]) -> [String; HORIZONS_S.len()] {
    std::array::from_fn(|horizon| match ratio(errors, horizon, way, rivals) {
        None => "-".into(),
        Some(Ratio { value, flights: 1, best, .. }) => format!("{value:.2} (1) {}", WAYS[best]),
        Some(Ratio { value, error, flights, best }) => {
            format!("{value:.2} ± {error:.2} ({flights}) {}", WAYS[best])
        }
    })
}

/// The ratio at number `horizon` of [`HORIZONS_S`]; `None` if no flight held out is long enough.
///
/// The best rival is the one with the lowest mean over the flights held out. It is chosen after the fact, in favour of the
/// rivals.
fn ratio(errors: &[Errors], horizon: usize, way: usize, rivals: &[usize]) -> Option<Ratio> {
    let known: Vec<&Errors> = errors.iter().filter(|e| e[way][horizon].is_finite()).collect();
    let n = known.len() as f64;
    let mean = |way: usize| known.iter().map(|e| e[way][horizon]).sum::<f64>() / n;
    // the mean of a rival that is missing for one of the flights is NaN
    let rivals = rivals.iter().copied().filter(|way| mean(*way).is_finite());
    let best = rivals.min_by(|a, b| mean(*a).total_cmp(&mean(*b)))?;
    let value = mean(way) / mean(best);
    // to first order, the error of a ratio of two means is that of the mean of these differences, relative to the denominator
    let left = |e: &&Errors| e[way][horizon] - value * e[best][horizon];
    let spread = known.iter().map(|e| left(e).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (spread / n).sqrt() / mean(best);
    Some(Ratio { value, error, flights: known.len(), best })
}
