//! Curve of an effect's contribution to a force or moment, over the regime variable that explains most of the contribution's
//! variance. Regime variables describe the flight condition, for example the angle of attack. The values are means over windows,
//! which are short intervals of a flight.

use crate::compare::{ChannelId, RegimeVariable};
use crate::diagnose::answer::result::Curve;
use crate::diagnose::regression::gather::Column;
use crate::diagnose::search::round::Round;

/// Number of bins of equal count for the choice of the variable.
const PLACES: usize = 12;
/// Number of bins of equal width for the curve. Bins of equal count would not reach the ends of the range, where windows are
/// sparse.
const WIDTHS: usize = 24;
/// Regime variables that do not describe the state of the aircraft. Curves are not plotted over them.
const NOT_SHOWN: [RegimeVariable; 3] =
    [RegimeVariable::Altitude, RegimeVariable::Time, RegimeVariable::Flight];

/// Computes the curve of an effect in the first of `channels`. `contribution` holds the effect's contribution in each window of
/// each flight.
///
/// `relative` is the standard deviation of the contribution relative to its value. `left` states whether the residual of `round`,
/// a linearisation of the model over the flights, still contains the contribution. `None` if there is no channel or no window.
pub fn curve(
    round: &Round,
    contribution: &[Column],
    channels: &[usize],
    relative: f64,
    left: bool,
) -> Option<Curve> {
    let channel = *channels.first()?;
    let id = ChannelId::ALL[channel];
    let residual = round.tuned_residual();
    let (mut made, mut scatter, mut regimes) = (Vec::new(), Vec::new(), Vec::new());
    for ((flight, own), residual) in round.flights.iter().zip(contribution).zip(&residual) {
        for (w, window) in flight.acting.windows.iter().enumerate() {
            let (Some(x), Some(r)) = (own[channel].get(w), residual[channel].get(w)) else {
                continue;
            };
            if r.is_finite() {
                made.push(*x);
                scatter.push(r + if left { 0.0 } else { *x });
                regimes.push(window.regime);
            }
        }
    }
    over_the_best(id, made, scatter, &regimes, relative)
}

/// Computes the curve of an effect in the channel `id` over the regime variable that explains most of the
/// contribution's variance.
///
/// `made` holds the contribution in each window, and `scatter` the partial residual (see [`Curve::residual`]), both in the
/// channel's unit. `regimes` holds the regime variables of each window. `relative` is the standard deviation of the
/// contribution relative to its value.
pub fn over_the_best(
    id: ChannelId,
    made: Vec<f64>,
    scatter: Vec<f64>,
    regimes: &[[f64; RegimeVariable::CONTINUOUS.len()]],
    relative: f64,
) -> Option<Curve> {
    if made.is_empty() {
        return None;
    }
    let shown = |k: &usize| !NOT_SHOWN.contains(&RegimeVariable::CONTINUOUS[*k]);
    let best = (0..RegimeVariable::CONTINUOUS.len())
        .filter(shown)
        .map(|k| (k, explained(&made, &regimes.iter().map(|r| r[k]).collect::<Vec<_>>())))
        .max_by(|a, b| a.1.total_cmp(&b.1))?
        .0;
    let x: Vec<f64> = regimes.iter().map(|r| r[best]).collect();
    let variable = RegimeVariable::CONTINUOUS[best];
    let bins = over_the_range(&made, &x);
    Some(Curve {
        channel: id.symbol().into(),
        variable: format!("{} {}", variable.name(), variable.unit()).trim().into(),
        unit: id.unit().into(),
        at: bins.iter().map(|b| b[0]).collect(),
        contribution: bins
            .iter()
            .map(|[_, y]| {
                let by = 1.96 * relative * y.abs();
                [*y, y - by, y + by]
            })
            .collect(),
        x,
        residual: scatter,
    })
}

/// Means of `x` and `y` in bins of equal count along `x`, with the count. The last bin may be smaller.
fn bins(y: &[f64], x: &[f64]) -> Vec<[f64; 3]> {
    let mut order: Vec<usize> = (0..x.len()).collect();
    order.sort_by(|a, b| x[*a].total_cmp(&x[*b]));
    let size = order.len().div_ceil(PLACES).max(1);
    let mean =
        |bin: &[usize], of: &[f64]| bin.iter().map(|k| of[*k]).sum::<f64>() / bin.len() as f64;
    order.chunks(size).map(|bin| [mean(bin, x), mean(bin, y), bin.len() as f64]).collect()
}

/// Means of `x` and `y` in bins of equal width over the whole range of `x`. Empty bins are omitted.
fn over_the_range(y: &[f64], x: &[f64]) -> Vec<[f64; 2]> {
    let (low, high) =
        x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let width = (high - low).max(f64::MIN_POSITIVE) / WIDTHS as f64;
    let mut sums = vec![[0.0; 3]; WIDTHS];
    for (x, y) in x.iter().zip(y) {
        let bin = (((x - low) / width) as usize).min(WIDTHS - 1);
        sums[bin].iter_mut().zip([*x, *y, 1.0]).for_each(|(sum, v)| *sum += v);
    }
    let filled = sums.into_iter().filter(|[.., count]| *count > 0.0);
    filled.map(|[x, y, count]| [x / count, y / count]).collect()
}

/// Fraction of the variance of `y` that lies between the bins along `x` (correlation ratio).
fn explained(y: &[f64], x: &[f64]) -> f64 {
    let mean = y.iter().sum::<f64>() / y.len().max(1) as f64;
    let all: f64 = y.iter().map(|v| (v - mean).powi(2)).sum();
    let between: f64 = bins(y, x).iter().map(|[_, m, count]| count * (m - mean).powi(2)).sum();
    if all > 0.0 { between / all } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_window_there_is_no_curve() {
        assert!(over_the_best(ChannelId::Lift, Vec::new(), Vec::new(), &[], 0.1).is_none());
    }

    #[test]
    fn a_curve_reaches_as_far_as_the_data() {
        // most windows lie within ±1, a few reach ±10
        let x: Vec<f64> = (0..200)
            .map(|k| if k % 20 == 0 { k as f64 / 10.0 - 10.0 } else { (k as f64).sin() })
            .collect();
        let y: Vec<f64> = x.iter().map(|x| x * x).collect();
        let curve = over_the_range(&y, &x);
        let (first, last) = (curve[0], curve[curve.len() - 1]);
        // a bin is 0.8 wide, so the means of the end bins lie within 0.8 of the ends
        assert!(first[0] < -9.2 && last[0] > 7.2, "{first:?} {last:?}");
        assert!((first[1] - first[0].powi(2)).abs() < 0.2);
    }
}
