//! The worst regime of a channel: the flight condition in which a model fails most. A channel is a force, a moment or a rate.
//! Its residual is the measured minus the predicted value. A regime is a range of a regime variable, such as the angle of
//! attack. The ranges of a variable in which mean residuals are computed are called bins.

use super::bins::{self, Residual, SUPPORT};
use super::discovery;
use super::result::{Bin, Regime, RegimeBins};
use crate::weak_form::channels::RegimeVariable;
use crate::weak_form::prepared::Prepared;

/// A variable can define a regime only if it explains more than this fraction of the residual's variance.
const SHARE_FLOOR: f64 = 0.1;
/// The fraction of the variance that time, altitude or flight explain is reduced by this margin before it is compared with
/// those of other variables.
const CIRCUMSTANCE_MARGIN: f64 = 0.15;
/// The residual mainly depends on a variable that explains more than this fraction of its variance.
const FOLLOWS: f64 = 0.5;
/// A bin next to the worst bin belongs to the regime if its mean residual is at least this fraction of the worst bin's.
const RANGE_PART: f64 = 0.5;
/// A flight is listed with a regime only if it has at least this number of independent samples in it.
const FLIGHT_SUPPORT: usize = 5;

/// Trend of the residual along the variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trend {
    /// The magnitude of the residual grows with the variable.
    Grows,
    /// The magnitude of the residual falls with the variable.
    Falls,
    /// The sign of the residual changes along the variable.
    Reverses,
    /// The residual has none of these trends.
    None,
}

/// The worst regime, and the trend of the residual.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The regime with its range and mean residual.
    pub regime: Regime,
    /// Trend of the residual along the regime's variable.
    pub trend: Trend,
}

/// The worst regime of the channel with index `channel`. `seed` is that of the bootstraps.
///
/// If no variable defines a regime, the regime comprises all samples. The result is then `None` if the mean residual over all
/// samples does not differ significantly from zero, or if there are too few samples.
pub fn worst(
    residuals: &[Residual],
    bins: &[RegimeBins],
    flights: &[Prepared],
    seed: u64,
    channel: u64,
) -> Option<Finding> {
    let everywhere = || {
        let all: Vec<&Residual> = residuals.iter().collect();
        let (_, interval) = bins::mean_interval(all.iter().copied(), seed, &[channel, 100]);
        (excludes_zero(interval) && bins::independent(all.iter().copied()) >= SUPPORT).then(|| {
            let regime = regime(&all, None, [f64::NAN; 2], flights, seed, channel);
            Finding { regime, trend: Trend::None }
        })
    };
    let Some(decisive) = most_informative(bins).filter(|b| !is_constant(residuals, b)) else {
        return everywhere();
    };
    let Some((from, to)) = range(&decisive.bins) else { return everywhere() };
    let (first, last) = (&decisive.bins[from], &decisive.bins[to]);
    let inside: Vec<&Residual> =
        residuals.iter().filter(|r| lies_in(r, decisive.variable, first.low, last.high)).collect();
    let ends = [first.low, last.high];
    let regime = regime(&inside, Some(decisive.variable), ends, flights, seed, channel);
    let ordered = decisive.variable != RegimeVariable::Flight;
    let trend = if ordered { trend(&decisive.bins) } else { Trend::None };
    Some(Finding { regime, trend })
}

/// The variable on which the residual mainly depends; `None` if there is none. Its bins may have too few samples for a regime.
pub fn follows(bins: &[RegimeBins]) -> Option<RegimeVariable> {
    most_informative(bins).filter(|b| b.explained > FOLLOWS).map(|b| b.variable)
}

fn excludes_zero([low, high]: [f64; 2]) -> bool {
    low > 0.0 || high < 0.0
}

/// The bins of the variable that explains the largest fraction of the residual's variance. The fractions of time, altitude and
/// flight are reduced by `CIRCUMSTANCE_MARGIN` first. `None` if the largest fraction is not above `SHARE_FLOOR`.
fn most_informative(bins: &[RegimeBins]) -> Option<&RegimeBins> {
    use RegimeVariable::{Altitude, Flight, Time};
    let worth = |b: &RegimeBins| {
        let circumstance = matches!(b.variable, Time | Altitude | Flight);
        b.explained - if circumstance { CIRCUMSTANCE_MARGIN } else { 0.0 }
    };
    let best = bins.iter().max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
    (worth(best) > SHARE_FLOOR).then_some(best)
}

/// Whether the residual is nearly constant: the variance that the variable explains is less than a tenth of the squared mean of
/// the residual.
fn is_constant(residuals: &[Residual], decisive: &RegimeBins) -> bool {
    let count = residuals.len() as f64;
    let mean = residuals.iter().map(|r| r.value).sum::<f64>() / count;
    let square = residuals.iter().map(|r| r.value * r.value).sum::<f64>() / count;
    decisive.explained * (square - mean * mean) < 0.1 * mean * mean
}

/// Indices of the first and the last bin of the regime. It contains the worst bin and the bins next to it with similar means. The
/// worst bin is the significant one whose 95 % interval is farthest from zero. `None` if no bin is significant.
fn range(bins: &[Bin]) -> Option<(usize, usize)> {
    let sure = |b: &Bin| b.interval[0].abs().min(b.interval[1].abs());
    let peak = (0..bins.len())
        .filter(|&k| discovery::found(&bins[k]))
        .max_by(|&a, &b| sure(&bins[a]).total_cmp(&sure(&bins[b])))?;
    let worst = bins[peak].mean;
    // bins with too few samples may belong to the regime, because together with the worst bin they have enough
    let alike = |k: usize| bins[k].label.is_empty() && bins[k].mean / worst >= RANGE_PART;
    let from = (0..peak).rev().take_while(|&k| alike(k)).last().unwrap_or(peak);
    let to = (peak + 1..bins.len()).take_while(|&k| alike(k)).last().unwrap_or(peak);
    Some((from, to))
}

fn lies_in(r: &Residual, variable: RegimeVariable, low: f64, high: f64) -> bool {
    let place = RegimeVariable::CONTINUOUS.iter().position(|v| *v == variable);
    let x = place.map_or(r.flight as f64, |v| r.regime[v]);
    // NaN stands for an open end; comparisons with NaN are false
    !(x < low || x >= high)
}

fn regime(
    inside: &[&Residual],
    variable: Option<RegimeVariable>,
    [low, high]: [f64; 2],
    flights: &[Prepared],
    seed: u64,
    channel: u64,
) -> Regime {
    let (mean, interval) = bins::mean_interval(inside.iter().copied(), seed, &[channel, 101]);
    let shows = |k: &usize| {
        let own = || inside.iter().copied().filter(|r| r.flight == *k);
        let sum: f64 = own().map(|r| r.value).sum();
        bins::independent(own()) >= FLIGHT_SUPPORT && sum * mean > 0.0
    };
    Regime {
        variable,
        low,
        high,
        unit: variable.map_or("", RegimeVariable::unit),
        mean,
        interval,
        relative_percent: relative_percent(inside, mean),
        independent: bins::independent(inside.iter().copied()),
        flights: (0..flights.len()).filter(shows).map(|k| flights[k].name.clone()).collect(),
    }
}

/// The relative error (model − measured) / measured, %, computed from means. `mean` is the mean residual. NaN unless at least
/// 90 % of the measured values have the sign of their mean.
fn relative_percent(inside: &[&Residual], mean: f64) -> f64 {
    let measured = inside.iter().map(|r| r.measured).sum::<f64>() / inside.len() as f64;
    let same = inside.iter().filter(|r| r.measured * measured > 0.0).count() as f64;
    if same >= 0.9 * inside.len() as f64 { -100.0 * mean / measured } else { f64::NAN }
}

/// Trend of the mean residual over the bins that have enough samples; `Trend::None` for fewer than four such bins.
fn trend(bins: &[Bin]) -> Trend {
    let known: Vec<&Bin> = bins.iter().filter(|b| b.supported).collect();
    if known.len() < 4 {
        return Trend::None;
    }
    let signed = correlation(&known, |b| b.mean);
    let size = correlation(&known, |b| b.mean.abs());
    let significant = || known.iter().filter(|b| discovery::found(b));
    let reverses = significant().any(|b| b.mean > 0.0) && significant().any(|b| b.mean < 0.0);
    if reverses && signed.abs() > 0.9 && size.abs() < 0.9 {
        Trend::Reverses
    } else if size > 0.9 {
        Trend::Grows
    } else if size < -0.9 {
        Trend::Falls
    } else {
        Trend::None
    }
}

/// Correlation of the bins' centres with `y`. Each bin has its number of independent samples as weight.
fn correlation(bins: &[&Bin], y: impl Fn(&Bin) -> f64) -> f64 {
    let weight = |b: &Bin| b.independent as f64;
    let total: f64 = bins.iter().map(|b| weight(b)).sum();
    let mean = |f: &dyn Fn(&Bin) -> f64| bins.iter().map(|b| weight(b) * f(b)).sum::<f64>() / total;
    let (mx, my) = (mean(&|b| b.center), mean(&y));
    let xy = mean(&|b| (b.center - mx) * (y(b) - my));
    let (xx, yy) = (mean(&|b| (b.center - mx).powi(2)), mean(&|b| (y(b) - my).powi(2)));
    xy / (xx * yy).sqrt()
}
