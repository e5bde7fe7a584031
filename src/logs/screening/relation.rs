//! Tools for relations between the columns of a log: short windows of rows, integrals over them, and regressions.

use nalgebra::{DMatrix, DVector};

use crate::Sample;
use greylag_num::statistics;

/// A gap of at least this many median sample periods ends a window.
const PAUSE_PERIODS: f64 = 5.0;
/// Smallest number of pairs for a regression.
const FEWEST: usize = 12;

/// The finite values of `get` over `rows`.
pub fn values(rows: &[Sample], get: impl Fn(&Sample) -> f64) -> Vec<f64> {
    rows.iter().map(get).filter(|x| x.is_finite()).collect()
}

/// Largest bank and pitch angle (rad) at which a row is used to check the sign of a column. `TAME_RATE` is the largest pitch and
/// yaw rate (rad/s).
const TAME: [f64; 2] = [1.3, 0.7];
const TAME_RATE: f64 = 3.0;

/// Whether attitude and body rates are within these limits. A missing value counts as within them.
pub fn tame(s: &Sample) -> bool {
    let beyond = |x: f64, limit: f64| x.abs() > limit;
    let attitude = (0..2).any(|i| beyond(s.attitude_rad[i], TAME[i]));
    let rates = (1..3).any(|i| beyond(s.rates_radps[i], TAME_RATE));
    !attitude && !rates
}

/// Quantile `q` of `values`; `None` if there are fewer than [`super::ENOUGH`].
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    (values.len() >= super::ENOUGH).then(|| statistics::quantile(values, q))
}

/// Whether `x` differs from `target` by less than the fraction `tolerance` of it.
pub fn near(x: f64, target: f64, tolerance: f64) -> bool {
    (x / target - 1.0).abs() < tolerance
}

/// Consecutive windows of about `length_s` (s). No window contains a gap.
pub fn windows(rows: &[Sample], length_s: f64) -> Vec<&[Sample]> {
    let times = values(rows, |s| s.time_s);
    let periods: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).filter(|p| *p > 0.0).collect();
    let Some(period) = quantile(&periods, 0.5) else { return Vec::new() };
    let (mut out, mut start) = (Vec::new(), 0);
    for i in 1..rows.len() {
        let step = rows[i].time_s - rows[i - 1].time_s;
        if !(step > 0.0 && step < PAUSE_PERIODS * period) {
            start = i;
        } else if rows[i].time_s - rows[start].time_s >= length_s - 0.5 * period && i > start {
            out.push(&rows[start..=i]);
            start = i;
        }
    }
    out
}

/// The integral of `rate` over a window by the trapezoidal rule.
pub fn integral(window: &[Sample], rate: impl Fn(&Sample) -> f64) -> f64 {
    let Some(first) = window.first() else { return 0.0 };
    let mut before = rate(first);
    let step = |w: &[Sample]| {
        let now = rate(&w[1]);
        0.5 * (std::mem::replace(&mut before, now) + now) * (w[1].time_s - w[0].time_s)
    };
    window.windows(2).map(step).sum()
}

/// The mean of `value` over a window.
pub fn mean(window: &[Sample], value: impl Fn(&Sample) -> f64) -> f64 {
    window.iter().map(value).sum::<f64>() / window.len() as f64
}

/// The change of `value` from the first to the last row of a window.
pub fn change(window: &[Sample], value: impl Fn(&Sample) -> f64) -> f64 {
    value(&window[window.len() - 1]) - value(&window[0])
}

/// Result of a regression of y on x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relation {
    /// Slope dy/dx of the fitted line.
    pub slope: f64,
    /// Correlation coefficient of x and y, −1..1.
    pub correlation: f64,
}

/// Regression of y on x through the origin; `None` for too few finite pairs.
pub fn through_origin(pairs: impl Iterator<Item = (f64, f64)>) -> Option<Relation> {
    relation(pairs.filter(|(x, y)| x.is_finite() && y.is_finite()).collect())
}

/// Regression of y on x with an intercept; `None` for too few finite pairs.
pub fn with_intercept(pairs: impl Iterator<Item = (f64, f64)>) -> Option<Relation> {
    let pairs: Vec<_> = pairs.filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let n = pairs.len() as f64;
    let (mx, my) =
        (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
    relation(pairs.into_iter().map(|(x, y)| (x - mx, y - my)).collect())
}

fn relation(pairs: Vec<(f64, f64)>) -> Option<Relation> {
    let sum = |f: fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>();
    let (xx, yy, xy) = (sum(|p| p.0 * p.0), sum(|p| p.1 * p.1), sum(|p| p.0 * p.1));
    (pairs.len() >= FEWEST && xx > 0.0 && yy > 0.0)
        .then(|| Relation { slope: xy / xx, correlation: xy / (xx * yy).sqrt() })
}

/// The partial correlation of y with the last regressor, with the other regressors and a constant partialled out
/// (Frisch–Waugh–Lovell). Each row has the regressors and y. `None` for too few rows, or if the other regressors determine the
/// last one.
pub fn partial_correlation(rows: &[(Vec<f64>, f64)]) -> Option<f64> {
    let width = rows.first()?.0.len();
    if rows.len() < 10 * width {
        return None;
    }
    let others = DMatrix::from_fn(rows.len(), width, |i, j| match j {
        0 => 1.0,
        _ => rows[i].0[j - 1],
    });
    let y = DVector::from_iterator(rows.len(), rows.iter().map(|r| r.1));
    let x = DVector::from_iterator(rows.len(), rows.iter().map(|r| r.0[width - 1]));
    let gram = (others.transpose() * &others).cholesky()?;
    let rest = |v: &DVector<f64>| v - &others * gram.solve(&(others.transpose() * v));
    let (x, y, whole) = (rest(&x), rest(&y), x.norm());
    let product = x.norm() * y.norm();
    (x.norm() > 1e-3 * whole && product > 0.0).then(|| x.dot(&y) / product)
}
