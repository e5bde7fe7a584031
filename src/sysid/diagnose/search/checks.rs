//! Checks of a candidate (a physical effect that the model may lack) in addition to its evidence: error on held-out blocks,
//! stability over bootstraps, and consistency between flights. The limits of the checks are in `stepwise/examine.rs` and
//! `stepwise/judge.rs`.
//!
//! The checks use the regression of the search. Its rows are means over windows (short stretches of flight) in six channels, the
//! forces and moments. The rows are whitened: filtered so that the noise has variance 1 and is white. A column is a regressor.
//! The columns of nuisance parameters (coefficients of the model, constants of a flight, sensor errors) are projected out. A
//! block is a stretch of about 4 s. A round is the search for one effect.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rayon::prelude::*;

use crate::diagnose::regression::cells::{Cells, Placed};
use crate::diagnose::regression::columns::combine;
use crate::diagnose::regression::noise::Noise;
use crate::diagnose::regression::projected::{Known, Projected, scaled_inverse};
use crate::diagnose::regression::rank::{Draw, Point, Score, Trial, quadratic};
use crate::diagnose::search::round::Round;
use greylag_num::stream::stream;

/// 99 % quantile of the standard normal distribution.
const NORMAL_99: f64 = 2.326;
/// Number of folds of the cross-validation over blocks.
const FOLDS: usize = 5;
/// Number that separates the random stream of the bootstraps from others with the same seed.
const BOOTSTRAPS: u64 = 82;
/// First condition for two effects that the flights cannot distinguish: the magnitude of the correlation of their contributions
/// exceeds this value.
pub const ALIKE: f64 = 0.9;
/// Second condition: the evidence of the other effect is less than this amount below that of the effect.
pub const CLOSE: f64 = 10.0;
/// Relative uncertainty of the noise variance. Without a missing effect, the mean square of the whitened residual differed from 1
/// by −0.03 to 0.07.
const UNSURE: f64 = 0.1;
/// A residual sum of squares is significant if it exceeds its expectation for pure noise by this number of standard deviations.
const DOUBT: f64 = 4.0;
/// Part of a flight's information on a coefficient is due to noise in the regressors. The flight yields an estimate only if the
/// rest exceeds this share of the information.
const LEAST_SIGNAL: f64 = 0.5;
/// First condition for a candidate that merely undoes changes of existing coefficients. The fit changes these coefficients from
/// their prior means. The candidate reduces the sum of the squares of these changes, in prior standard deviations, by more than
/// the square of this number.
const PRIOR_MISFIT: f64 = 5.0;
/// Second condition for such a candidate. This reduction is more than this share of the candidate's reduction of the whole cost,
/// which also contains the residual.
const PRIOR_SHARE: f64 = 0.9;
/// Number of best candidates that compete in each bootstrap.
const COMPETING: usize = 8;

/// Share of the residual beyond noise that the candidate `trial` removes in held-out blocks, in the channels in which it acts.
/// The residual beyond noise is the whitened residual sum of squares minus its expectation for pure noise.
///
/// The blocks are divided into five groups, each of which is held out once. The candidate's coefficients are fitted to the other
/// blocks. NaN if such a fit is singular.
pub fn heldout_reduction(round: &Round, trial: &Trial, score: &Score) -> f64 {
    let p = &round.projected;
    let last = p.width();
    let directions = directions(trial, score);
    let mut taken = 0.0;
    for fold in 0..FOLDS {
        let inside = |b: usize| b % FOLDS == fold;
        let mut train = p.prior.clone();
        let mut test = DMatrix::zeros(last + 1, last + 1);
        for (b, gram) in p.blocks.iter().enumerate() {
            if inside(b) { test += gram } else { train += gram }
        }
        let reduce = |m: &DMatrix<f64>| {
            let gram = DMatrix::from_fn(directions.len(), directions.len(), |i, j| {
                quadratic(&directions[i], &directions[j], m)
            });
            let product = DVector::from_iterator(
                directions.len(),
                directions.iter().map(|d| d.iter().map(|(c, w)| w * m[(*c, last)]).sum::<f64>()),
            );
            (gram, product)
        };
        let (gram, product) = reduce(&train);
        let Some(inverse) = scaled_inverse(&gram) else { return f64::NAN };
        let amounts = inverse * product;
        let (gram, product) = reduce(&test);
        taken += 2.0 * amounts.dot(&product) - amounts.dot(&(gram * &amounts));
    }
    taken / excess(round, &trial.channels).max(taken).max(1.0)
}

/// Residual beyond noise of each channel: the whitened residual sum of squares minus its expectation for pure noise.
#[derive(Clone, Debug)]
pub struct Beyond {
    excess: [f64; 6],
    rows: [f64; 6],
}

impl Beyond {
    /// The residual beyond noise of the model of `round`. The round must have no candidates. Otherwise all candidates would be
    /// regressors when the noise is estimated, and might remove up to half of the noise of the moments.
    pub fn of(round: &Round) -> Beyond {
        let only = |c: usize| std::array::from_fn(|k| k == c);
        Beyond {
            excess: std::array::from_fn(|c| excess(round, &only(c))),
            rows: std::array::from_fn(|c| rows(round, &only(c))),
        }
    }

    /// The share of the residual beyond noise in `channels` that remains after an effect was added. `self` is the remaining
    /// residual, and `fall` is the reduction of the residual sum of squares by the effect. `None` if the remaining residual is
    /// not significant.
    pub fn share(&self, channels: &[usize], fall: f64) -> Option<f64> {
        let own = |of: &[f64; 6]| channels.iter().map(|c| of[*c]).sum::<f64>();
        let (left, rows) = (own(&self.excess), own(&self.rows));
        // the sum of the squares of n values of white noise with variance 1 has the standard deviation √(2n)
        let beyond_doubt = left > f64::max(DOUBT * (2.0 * rows).sqrt(), UNSURE * rows);
        beyond_doubt.then(|| left / (left + fall))
    }
}

/// Residual beyond noise in `channels`: the whitened residual sum of squares minus its expectation for pure noise.
pub fn excess(round: &Round, channels: &[bool; 6]) -> f64 {
    let blocks = round.projected.by_channel.iter();
    let of = |sums: &[(f64, usize); 6]| -> f64 {
        (0..6).filter(|c| channels[*c]).map(|c| sums[c].0).sum()
    };
    blocks.map(of).sum::<f64>() - rows(round, channels)
}

/// Number of rows of the regression in `channels`. It is the expectation of the sum of squares of the whitened noise.
fn rows(round: &Round, channels: &[bool; 6]) -> f64 {
    let all = round.projected.rows_by_channel();
    (0..6).filter(|c| channels[*c]).map(|c| all[c]).sum()
}

/// Combinations of columns whose amplitudes are fitted by [`heldout_reduction`]: each column of a linear candidate, or the whole
/// contribution of a nonlinear candidate. A combination is a list of column indices with weights.
fn directions(trial: &Trial, score: &Score) -> Vec<Vec<(usize, f64)>> {
    match trial.points[score.point].contribution {
        None => score.weights.iter().map(|(c, _)| vec![(*c, 1.0)]).collect(),
        Some(_) => vec![score.weights.clone()],
    }
}

/// Whether the candidate with this `score` merely undoes changes of existing coefficients.
///
/// Without such a candidate, the fit moves coefficients far from their prior means and thereby explains the residual. With it,
/// the coefficients return to their prior means, and the residual hardly becomes smaller.
pub fn absorbs_prior_error(round: &Round, score: &Score) -> bool {
    let prior = &round.projected.prior;
    let last = round.projected.width();
    let linear: f64 = score.weights.iter().map(|(c, w)| w * prior[(*c, last)]).sum();
    let reduction = 2.0 * linear - quadratic(&score.weights, &score.weights, prior);
    reduction > PRIOR_MISFIT.powi(2) && reduction > PRIOR_SHARE * score.fall
}

/// Correlation of the fitted contributions of two candidates, after the nuisance parameters were projected out.
pub fn correlation(round: &Round, a: &Score, b: &Score) -> f64 {
    let total = &round.projected.total;
    let of = |u: &Score, v: &Score| quadratic(&u.weights, &v.weights, total);
    of(a, b) / (of(a, a) * of(b, b)).sqrt()
}

/// Indices in `scores` of the effects that these flights cannot distinguish from the effect with index `of`. An entry of `scores`
/// is the index of a candidate with its score.
pub fn class(round: &Round, scores: &[(usize, Score)], of: usize) -> Vec<usize> {
    let (_, own) = &scores[of];
    (0..scores.len())
        .filter(|k| *k != of)
        .filter(|k| {
            let (trial, other) = &scores[*k];
            other.evidence > own.evidence - CLOSE
                && !round.at_bound(*trial, other)
                && correlation(round, own, other).abs() > ALIKE
        })
        .collect()
}

/// Share of `count` block bootstraps in which one of the candidates `class` ranks first. The candidates are listed in `open`,
/// the best first, and the first `COMPETING` of them compete. Blocks are drawn separately for each flight.
pub fn selected(round: &Round, open: &[usize], class: &[usize], count: usize) -> f64 {
    let seed = round.seed;
    let by_flight: Vec<Vec<usize>> = (0..round.flights.len())
        .map(|f| {
            let of = &round.cells.flight_of_block;
            (0..of.len()).filter(|b| of[*b] == f).collect()
        })
        .collect();
    let competing = &open[..open.len().min(COMPETING)];
    let wins = (0..count)
        .into_par_iter()
        .filter(|k| {
            let mut random = stream(seed, &[BOOTSTRAPS, *k as u64]);
            let mut drawn = Vec::new();
            for blocks in by_flight.iter().filter(|b| !b.is_empty()) {
                for _ in 0..blocks.len() {
                    drawn.push(blocks[random.random_range(0..blocks.len() as u32) as usize]);
                }
            }
            let grams = round.projected.resampled(drawn.into_iter());
            let draw = Draw::measured(&grams);
            let best = competing
                .iter()
                .filter_map(|t| Some((*t, round.trials[*t].score(&grams, &draw)?)))
                .filter(|(t, s)| !round.at_bound(*t, s))
                .max_by(|a, b| a.1.order.total_cmp(&b.1.order));
            best.is_some_and(|(t, s)| class.contains(&t) && s.evidence > 0.0)
        })
        .count();
    wins as f64 / count.max(1) as f64
}

/// Estimates of the free coefficients of the candidate `trial` from each flight alone.
///
/// Returns one entry for each free coefficient: its index among the candidate's coefficients, and for each flight the estimate
/// and its standard deviation. Both are NaN for a flight with too little information.
///
/// Sensor errors are estimated again for each flight. The priors of the model's coefficients are the estimates from all flights.
/// Otherwise, noise in the regressors of a flight with little excitation would bias the coefficients towards zero (errors in
/// variables).
pub fn by_flight(round: &Round, trial: &Trial, score: &Score) -> Vec<(usize, Vec<[f64; 2]>)> {
    let free = &trial.points[score.point].free;
    let flights: Vec<Vec<[f64; 2]>> = (0..round.flights.len())
        .map(|flight| {
            let found = one_flight(round, trial, score, flight);
            found.unwrap_or_else(|| vec![[f64::NAN; 2]; free.len()])
        })
        .collect();
    let of = |k: usize| -> Vec<[f64; 2]> { flights.iter().map(|all| all[k]).collect() };
    free.iter().enumerate().map(|(k, f)| (f.0, of(k))).collect()
}

/// Estimates and standard deviations of the free coefficients from the flight with index `flight` alone. `None` if they cannot be
/// computed.
fn one_flight(round: &Round, trial: &Trial, score: &Score, flight: usize) -> Option<Vec<[f64; 2]>> {
    let own: Vec<usize> =
        (0..round.cells.list.len()).filter(|k| round.cells.list[*k].flight == flight).collect();
    let cells = Cells {
        list: own.iter().map(|k| round.cells.list[*k].clone()).collect(),
        flight_of_block: round.cells.flight_of_block.clone(),
    };
    let residuals = own.iter().map(|k| round.noise.residuals[*k].clone()).collect();
    let noise = Noise { whiteners: round.noise.whiteners.clone(), residuals };
    let point = &trial.points[score.point];
    let columns: Vec<usize> = point.free.iter().map(|f| f.1).chain(point.contribution).collect();
    let (na, last) = (round.known.len(), round.known.len() + columns.len());
    let spurious = &round.shared[flight];
    let mut shared: Vec<f64> = spurious[..na].to_vec();
    shared.extend(columns.iter().map(|c| spurious.get(na + c).copied().unwrap_or(0.0)));
    let placed = alone(&round.placed, flight, na, &columns);
    let mut with_residual = placed.clone();
    let residual = round.placed[flight].iter().find(|(p, _)| *p == round.last)?;
    with_residual[flight].push((last, residual.1.clone()));
    let known = together(round, score);
    let p = Projected::new(&cells, &with_residual, last, &known, &noise, &shared)?;
    let free = point.free.iter().enumerate().map(|(k, f)| (f.0, k, f.2)).collect();
    let contribution = point.contribution.map(|_| point.free.len());
    let indices: Vec<usize> = point.free.iter().map(|f| f.0).collect();
    let point = Point { values: point.values.clone(), contribution, free };
    let by_itself = Trial { points: vec![point], ..trial.clone() };
    let grams = p.grams();
    let found = by_itself.score(&grams, &Draw::measured(&grams))?;
    // a residual beyond noise, for example due to another missing effect, may bias the estimate; the standard deviation is
    // therefore increased
    let misfit = misfit(&p, &trial.channels, found.fall);
    let each: Vec<[f64; 2]> =
        indices.iter().map(|i| [found.values[*i], misfit * found.deviations[*i]]).collect();
    if contribution.is_some() {
        return Some(each);
    }
    // noise in the regressors adds to the Gram matrix but contains no information; its part is therefore subtracted
    let disturbed = alone(&round.disturbed, flight, na, &columns);
    let added = less(&disturbed, &placed);
    let feint = p.others(&cells, &added, &noise.whiteners);
    let n = columns.len();
    let gram = grams.total.view((0, 0), (n, n)).into_owned();
    let corrected = &gram - feint.view((0, 0), (n, n));
    let (all, left) = (scaled_inverse(&gram)?, scaled_inverse(&corrected)?);
    let amounts = &left * grams.total.view((0, n), (n, 1)).column(0);
    let one = |(k, [_, sd]): (usize, &[f64; 2])| {
        let share = all[(k, k)] / left[(k, k)];
        if share > LEAST_SIGNAL { [amounts[k], sd / share] } else { [f64::NAN; 2] }
    };
    Some(each.iter().enumerate().map(one).collect())
}

/// Root mean square of the whitened residual in `channels` after a reduction of its sum of squares by `fall`. The result is at
/// least 1, the value for pure noise.
fn misfit(p: &Projected, channels: &[bool; 6], fall: f64) -> f64 {
    let own = |of: &[(f64, usize); 6]| (0..6).filter(|c| channels[*c]).map(|c| of[c]).collect();
    let all: Vec<Vec<(f64, usize)>> = p.by_channel.iter().map(own).collect();
    let square: f64 = all.iter().flatten().map(|(square, _)| square).sum();
    let rows: usize = all.iter().flatten().map(|(_, rows)| rows).sum();
    ((square - fall) / rows.max(1) as f64).max(1.0).sqrt()
}

/// The nuisance parameters for the fit to one flight. The prior of each coefficient of the model is its estimate from all
/// flights, fitted together with the effect that has this `score`.
fn together(round: &Round, score: &Score) -> Vec<Known> {
    let p = &round.projected;
    let mut all = round.known.clone();
    for (k, known) in all.iter_mut().take(round.coefficients.len()).enumerate() {
        let given: f64 = score.weights.iter().map(|(c, w)| w * p.taken[(k, *c)]).sum();
        // the effect's relative standard deviation is 1 / √wald; the change `given` that it causes has the same
        let astray = given.powi(2) / score.wald.max(1.0);
        known.offset = p.tuned[k] - given;
        known.width = (p.covariance[(k, k)].max(0.0) + astray).sqrt().min(known.width);
    }
    all
}

/// The columns in `placed` of the flight with index `flight`: those of the `na` nuisance parameters, then the candidate's columns
/// `columns`, renumbered from `na` on. The lists of all other flights are empty.
fn alone(placed: &[Placed], flight: usize, na: usize, columns: &[usize]) -> Vec<Placed> {
    let own = &placed[flight];
    let mut list: Placed = own.iter().take_while(|(p, _)| *p < na).cloned().collect();
    for (k, column) in columns.iter().enumerate() {
        let of = own.iter().find(|(p, _)| *p == na + column);
        list.extend(of.map(|(_, column)| (na + k, column.clone())));
    }
    let mut all = vec![Placed::new(); placed.len()];
    all[flight] = list;
    all
}

/// For each flight, the columns of `a` minus the columns of `b` with the same indices.
fn less(a: &[Placed], b: &[Placed]) -> Vec<Placed> {
    let of = |(a, b): (&Placed, &Placed)| {
        let both = a.iter().filter_map(|(p, x)| Some((*p, x, &b.iter().find(|(q, _)| q == p)?.1)));
        both.map(|(p, x, y)| (p, combine(&[x.clone(), y.clone()], &[1.0, -1.0]))).collect()
    };
    a.iter().zip(b).map(of).collect()
}

/// Whether the estimate of any flight contradicts `value`, the estimate from all flights. `flights` holds the estimate and
/// standard deviation of each flight.
///
/// An estimate contradicts `value` in two cases. It has the opposite sign and is more than three standard deviations from zero,
/// or it differs from `value` by more than four standard deviations and by more than half of `value`. An effect that
/// `absorbs_prior_error` has no other support than the agreement of the flights: their scatter must not exceed chance either.
pub fn contradict(value: f64, flights: &[[f64; 2]], absorbs_prior_error: bool) -> bool {
    let contradicts = |[own, sd]: &[f64; 2]| {
        let other_sign = own * value < 0.0 && own.abs() > 3.0 * sd;
        let off = (own - value).abs();
        other_sign || (off > 4.0 * sd && off > 0.5 * value.abs())
    };
    flights.iter().any(contradicts) || (absorbs_prior_error && scattered(flights))
}

/// Whether the estimates of the flights, each with its standard deviation, scatter more than chance allows: χ² test at 99 %.
fn scattered(flights: &[[f64; 2]]) -> bool {
    let known: Vec<[f64; 2]> = flights
        .iter()
        .map(|[own, sd]| [*own, sd.powi(-2)])
        .filter(|[own, weight]| own.is_finite() && weight.is_finite())
        .collect();
    if known.len() < 2 {
        return false;
    }
    let total: f64 = known.iter().map(|[_, weight]| weight).sum();
    let mean = known.iter().map(|[own, weight]| own * weight).sum::<f64>() / total;
    let scatter: f64 = known.iter().map(|[own, weight]| weight * (own - mean).powi(2)).sum();
    // quantile of χ² (Wilson and Hilferty, Proceedings of the National Academy of Sciences 17, 1931)
    let freedom = (known.len() - 1) as f64;
    let share = 2.0 / (9.0 * freedom);
    scatter > freedom * (1.0 - share + NORMAL_99 * share.sqrt()).powi(3)
}
