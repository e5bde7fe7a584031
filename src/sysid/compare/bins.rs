//! Mean residuals of a channel in bins of the regime variables, with 95 % intervals and numbers of independent samples. A
//! regime variable, such as α, locates a window in the flight envelope. A window is a stretch of flight over which a channel
//! (force, moment or rate) is averaged with a smooth kernel.

use super::bootstrap::{self, BLOCK_S, Block};
use super::doubt::{self, NORMAL_95, Shift};
use super::result::{Bin, Map, MapCell, RegimeBins};
use crate::weak_form::channels::{ChannelId, RegimeVariable};
use crate::weak_form::prepared::Prepared;
use crate::weak_form::windows::Series;
use greylag_num::statistics::{mean, quantile};

/// Smallest number of independent samples with which a bin counts as supported.
pub const SUPPORT: usize = 20;
/// Intended number of bins between the outermost edges of a regime variable.
const BINS: f64 = 8.0;
/// Intended number of bins along each side of the α–β map.
const MAP_BINS: f64 = 10.0;

/// Residual of one channel in one window, with the regime variables in the window.
#[derive(Clone, Copy, Debug)]
pub struct Residual<'a> {
    /// Measured minus predicted value, in the channel's unit.
    pub value: f64,
    /// Measured value, in the channel's unit.
    pub measured: f64,
    /// Index of the window's flight.
    pub flight: usize,
    /// Index of the block of windows that the bootstrap resamples together, ascending over all flights.
    pub block: usize,
    /// Values of the regime variables, in the order and units of [`RegimeVariable::CONTINUOUS`].
    pub regime: &'a [f64; RegimeVariable::CONTINUOUS.len()],
    /// Number of independent samples that the window represents: distance between two windows divided by the kernel's length.
    pub weight: f64,
    /// Change of the residual if a sensor error of the flight changes by one standard deviation, in the channel's unit. There
    /// is one value for each sensor error.
    pub shift: &'a Shift,
}

/// The finite residuals of `channel` over all flights. For each flight, `series` has the measured and predicted channels, and
/// `shifts` the changes of their residuals due to sensor errors.
pub fn residuals<'a>(
    channel: ChannelId,
    flights: &'a [Prepared],
    series: &[Vec<Series>],
    shifts: &'a [Vec<[Shift; ChannelId::ALL.len()]>],
) -> Vec<Residual<'a>> {
    let mut all = Vec::new();
    let (mut block, mut last) = (0, None);
    let place = ChannelId::ALL.iter().position(|id| *id == channel).unwrap_or_default();
    for (flight, (prepared, lists)) in flights.iter().zip(series).enumerate() {
        let Some(list) = lists.iter().find(|s| s.channel == channel) else { continue };
        let kernel = &prepared.kernel;
        let weight = kernel.stride() as f64 / kernel.steps() as f64;
        for (k, window) in prepared.windows.iter().enumerate() {
            let key = Some((flight, window.segment, (window.time_s / BLOCK_S).floor() as i64));
            if key != last {
                (block, last) = (block + 1, key);
            }
            let (measured, value) = (list.measured[k], list.measured[k] - list.predicted[k]);
            if value.is_finite() {
                let (regime, shift) = (&window.regime, &shifts[flight][k][place]);
                all.push(Residual { value, measured, flight, block, regime, weight, shift });
            }
        }
    }
    all
}

/// Number of independent samples in `residuals`, rounded down.
pub fn independent<'r, 'a: 'r>(residuals: impl Iterator<Item = &'r Residual<'a>>) -> usize {
    residuals.map(|r| r.weight).sum::<f64>().floor() as usize
}

/// Mean of `residuals` and its 95 % interval.
///
/// The interval is that of the block bootstrap, widened by the uncertainty of the sensor errors. `seed` and `path` select
/// the random stream of the bootstrap.
pub fn mean_interval<'r, 'a: 'r>(
    residuals: impl Iterator<Item = &'r Residual<'a>> + Clone,
    seed: u64,
    path: &[u64],
) -> (f64, [f64; 2]) {
    let doubt = NORMAL_95 * doubt::deviation(residuals.clone().map(|r| (r.flight, r.shift)));
    let blocks = bootstrap::blocks(residuals.map(|r| (r.block, r.value)));
    let sum = blocks
        .iter()
        .fold(Block::default(), |a, b| Block { sum: a.sum + b.sum, count: a.count + b.count });
    let mean = sum.sum / sum.count;
    let [low, high] = bootstrap::interval(&blocks, seed, path);
    (mean, [mean - (mean - low).hypot(doubt), mean + (high - mean).hypot(doubt)])
}

/// Bins over every regime variable that varies in the flights. With several flights, there is also one bin for each flight.
pub fn all(
    residuals: &[Residual],
    flights: &[Prepared],
    seed: u64,
    channel: u64,
) -> Vec<RegimeBins> {
    let mut found: Vec<RegimeBins> = RegimeVariable::CONTINUOUS
        .iter()
        .enumerate()
        .filter_map(|(v, variable)| continuous(residuals, *variable, v, seed, channel))
        .collect();
    if flights.len() > 1 {
        found.push(by_flight(residuals, flights, seed, channel));
    }
    found
}

fn continuous(
    residuals: &[Residual],
    variable: RegimeVariable,
    v: usize,
    seed: u64,
    channel: u64,
) -> Option<RegimeBins> {
    let values: Vec<f64> = residuals.iter().map(|r| r.regime[v]).collect();
    let edges = edges(&values, BINS, tail(independent(residuals.iter())))?;
    let count = edges.len() + 1;
    let mut members: Vec<Vec<&Residual>> = vec![Vec::new(); count];
    for r in residuals {
        members[edges.partition_point(|e| *e <= r.regime[v])].push(r);
    }
    let bin = |k: usize| Bin {
        low: k.checked_sub(1).map_or(f64::NAN, |i| edges[i]),
        high: edges.get(k).copied().unwrap_or(f64::NAN),
        center: mean(&members[k].iter().map(|r| r.regime[v]).collect::<Vec<_>>()),
        ..statistics(&members[k], seed, &[channel, v as u64, k as u64])
    };
    let bins = (0..count).filter(|k| !members[*k].is_empty()).map(bin).collect();
    let (name, unit) = (variable.name(), variable.unit());
    let explained = explained(&members).max(along_a_line(&values, residuals));
    Some(RegimeBins { variable, name, unit, explained, bins })
}

fn by_flight(residuals: &[Residual], flights: &[Prepared], seed: u64, channel: u64) -> RegimeBins {
    let variable = RegimeVariable::Flight;
    let mut members: Vec<Vec<&Residual>> = vec![Vec::new(); flights.len()];
    residuals.iter().for_each(|r| members[r.flight].push(r));
    let bin = |k: usize| Bin {
        low: k as f64 - 0.5,
        high: k as f64 + 0.5,
        center: k as f64,
        label: flights[k].name.clone(),
        ..statistics(&members[k], seed, &[channel, 99, k as u64])
    };
    RegimeBins {
        variable,
        name: variable.name(),
        unit: variable.unit(),
        explained: explained(&members),
        bins: (0..flights.len()).filter(|k| !members[*k].is_empty()).map(bin).collect(),
    }
}

/// Statistics of a bin with the residuals `members`. Its edges and its centre are NaN until the caller sets them.
fn statistics(members: &[&Residual], seed: u64, path: &[u64]) -> Bin {
    let (mean, interval) = mean_interval(members.iter().copied(), seed, path);
    let independent = independent(members.iter().copied());
    Bin {
        low: f64::NAN,
        high: f64::NAN,
        center: f64::NAN,
        label: String::new(),
        mean,
        interval,
        q_value: f64::NAN,
        measured: members.iter().map(|r| r.measured).sum::<f64>() / members.len() as f64,
        independent,
        supported: independent >= SUPPORT,
    }
}

/// Fraction of the residuals' variance that the means of the groups explain, adjusted for the number of groups.
fn explained(groups: &[Vec<&Residual>]) -> f64 {
    let total: Vec<f64> = groups.iter().flatten().map(|r| r.value).collect();
    let squares = |of: &[f64]| {
        let mean = mean(of);
        of.iter().map(|x| (x - mean).powi(2)).sum::<f64>()
    };
    let values = |g: &Vec<&Residual>| g.iter().map(|r| r.value).collect::<Vec<_>>();
    let filled: Vec<Vec<f64>> = groups.iter().filter(|g| !g.is_empty()).map(values).collect();
    let within: f64 = filled.iter().map(|g| squares(g)).sum();
    let count = independent(groups.iter().flatten().copied()) as f64;
    let k = filled.len() as f64;
    let share = 1.0 - (within / (count - k)) / (squares(&total) / (count - 1.0));
    if share.is_finite() && count > k { share.clamp(0.0, 1.0) } else { 0.0 }
}

/// Fraction of the samples in each of the two open bins at the ends: 1.2 times the fraction that gives a bin `SUPPORT`
/// independent samples, but at least 2 % and at most 20 %.
fn tail(independent: usize) -> f64 {
    (1.2 * SUPPORT as f64 / independent as f64).clamp(0.02, 0.2)
}

/// Fraction of the residuals' variance that a straight line over `values` explains, adjusted for its two parameters.
///
/// It supplements the bins, which are too coarse if a few extreme values cause most of the variance.
fn along_a_line(values: &[f64], residuals: &[Residual]) -> f64 {
    let (mx, my) =
        (mean(values), residuals.iter().map(|r| r.value).sum::<f64>() / values.len() as f64);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (x, r) in values.iter().zip(residuals) {
        xx += (x - mx).powi(2);
        xy += (x - mx) * (r.value - my);
        yy += (r.value - my).powi(2);
    }
    let count = independent(residuals.iter()) as f64;
    let share = 1.0 - (1.0 - xy * xy / (xx * yy)) * (count - 1.0) / (count - 2.0);
    if share.is_finite() && count > 2.0 { share.clamp(0.0, 1.0) } else { 0.0 }
}

/// Round numbers that divide the range between the quantiles `tail` and 1 − `tail` of `values` into about `bins` bins; `None` if
/// the values are constant.
fn edges(values: &[f64], bins: f64, tail: f64) -> Option<Vec<f64>> {
    let (low, high) = (quantile(values, tail), quantile(values, 1.0 - tail));
    let width = round_width((high - low) / bins);
    if !(width.is_finite() && width > 1e-9 * (1.0 + low.abs() + high.abs())) {
        return None;
    }
    let first = (low / width).ceil() as i64;
    let last = (high / width).floor() as i64;
    Some((first..=last).map(|k| k as f64 * width).collect())
}

/// Rounds `width` to 1, 2 or 5 times a power of ten.
fn round_width(width: f64) -> f64 {
    let power = 10_f64.powf(width.log10().floor());
    let lead = width / power;
    power
        * if lead < 1.5 {
            1.0
        } else if lead < 3.5 {
            2.0
        } else if lead < 7.5 {
            5.0
        } else {
            10.0
        }
}

/// Mean residual in cells of α and β.
pub fn map(residuals: &[Residual]) -> Map {
    let (alpha, beta) = (side(residuals, 0), side(residuals, 1));
    let (columns, rows) = (alpha.len() - 1, beta.len() - 1);
    let mut members: Vec<Vec<&Residual>> = vec![Vec::new(); columns * rows];
    let place = |edges: &[f64], x: f64| {
        edges.partition_point(|e| *e <= x).checked_sub(1).filter(|k| k + 1 < edges.len())
    };
    for r in residuals {
        if let (Some(a), Some(b)) = (place(&alpha, r.regime[0]), place(&beta, r.regime[1])) {
            members[b * columns + a].push(r);
        }
    }
    let cell = |(k, members): (usize, &Vec<&Residual>)| {
        let independent = independent(members.iter().copied());
        MapCell {
            alpha: k % columns,
            beta: k / columns,
            mean: mean(&members.iter().map(|r| r.value).collect::<Vec<_>>()),
            independent,
            supported: independent >= SUPPORT,
        }
    };
    let cells = members.iter().enumerate().filter(|(_, m)| !m.is_empty()).map(cell).collect();
    Map { alpha_deg: alpha, beta_deg: beta, cells }
}

/// Edges of the map's cells along regime variable `v` (0: α, 1: β), °.
///
/// The edges lie between the 2 % and 98 % quantiles, and one more cell is added at each end. Values beyond these cells are left
/// out of the map. A nearly constant variable has a single cell of 1°.
fn side(residuals: &[Residual], v: usize) -> Vec<f64> {
    let values: Vec<f64> = residuals.iter().map(|r| r.regime[v]).collect();
    let mut edges = edges(&values, MAP_BINS, 0.02).filter(|e| e.len() > 1).unwrap_or_default();
    let (Some(first), Some(last)) = (edges.first().copied(), edges.last().copied()) else {
        let middle = quantile(&values, 0.5).floor();
        return vec![middle, middle + 1.0];
    };
    let width = (last - first) / (edges.len() - 1) as f64;
    edges.insert(0, first - width);
    edges.push(last + width);
    edges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_round_and_cover_the_middle() {
        let values: Vec<f64> = (0..1000).map(|i| i as f64 * 0.013).collect();
        assert_eq!(edges(&values, 8.0, 0.02), Some((1..=6).map(|k| 2.0 * k as f64).collect()));
        assert_eq!(edges(&[3.0; 50], 8.0, 0.02), None);
        assert_eq!(edges(&[], 8.0, 0.02), None);
    }

    #[test]
    fn a_step_over_alpha_is_explained_by_alpha_and_not_by_time() {
        let regime = |i: usize| {
            // alpha runs through its values in another order than time, so that the two are not correlated
            let mut regime = [0.0; 13];
            (regime[0], regime[12]) = ((i * 37 % 100) as f64 / 10.0, i as f64);
            regime
        };
        let regimes: Vec<[f64; 13]> = (0..400).map(regime).collect();
        let shift = &Shift::default();
        let residual = |i: usize| {
            let regime = &regimes[i];
            let value = if regime[0] > 8.0 { 4.0 } else { 0.0 };
            Residual { value, measured: 10.0, flight: 0, block: i / 5, regime, weight: 0.5, shift }
        };
        let residuals: Vec<Residual> = (0..400).map(residual).collect();
        let found = all(&residuals, &[], 1, 0);
        let share = |v| found.iter().find(|b| b.variable == v).map_or(f64::NAN, |b| b.explained);
        assert!(share(RegimeVariable::Alpha) > 0.8, "{}", share(RegimeVariable::Alpha));
        assert!(share(RegimeVariable::Time) < 0.1, "{}", share(RegimeVariable::Time));
        // constant variables have no bins
        assert!(found.iter().all(|b| b.variable != RegimeVariable::Beta));
        let high = found[0].bins.last().unwrap();
        assert!(high.mean > 3.0 && high.low >= 8.0 && high.high.is_nan() && high.supported);
    }
}
