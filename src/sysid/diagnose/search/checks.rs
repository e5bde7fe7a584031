//! Checks of an effect in addition to its evidence: error on held-out blocks, stability over bootstraps, consistency
//! between flights.
//!
//! The limits of the checks are in `stepwise/examine.rs` and `stepwise/judge.rs`.

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

/// Number of folds of the cross-validation over blocks.
const FOLDS: usize = 5;
/// Number of the random stream for the bootstraps.
const BOOTSTRAPS: u64 = 82;
/// Two effects may be indistinguishable if the correlation of their contributions exceeds this magnitude.
pub const ALIKE: f64 = 0.9;
/// Two effects may be indistinguishable if their evidence differs by less than this value.
pub const CLOSE: f64 = 10.0;
/// Uncertainty of the noise variance, relative to this variance. Without a missing effect, the mean square of the
/// whitened residual differed from 1 by −0.03 to 0.07.
const UNSURE: f64 = 0.1;
/// A residual sum of squares is significant if it exceeds its expectation for noise by this number of standard
/// deviations.
const DOUBT: f64 = 4.0;
/// Smallest share of a flight's information on a coefficient that must come from excitation and not from noise in the
/// regressors. With a smaller share, the flight yields no estimate.
const LEAST_SIGNAL: f64 = 0.5;
/// First condition for a candidate that merely replaces changes of existing coefficients. It reduces the sum of their
/// squared deviations from the prior, in prior standard deviations, by more than the square of this number.
const PRIOR_MISFIT: f64 = 5.0;
/// Second condition for such a candidate. The same reduction is more than this share of the candidate's reduction of
/// the whole cost, which also contains the residual.
const PRIOR_SHARE: f64 = 0.9;
/// Number of candidates, the best first, that compete in a bootstrap.
const COMPETING: usize = 8;

/// Share of the residual beyond noise that the candidate removes from held-out blocks, in the channels in which it
/// acts. The residual beyond noise is the whitened residual sum of squares minus its expectation for pure noise.
///
/// Every fifth block is held out in turn. The candidate's coefficients are fitted to the other blocks. NaN if this fit
/// is singular.
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

/// Residual beyond noise by channel: the whitened residual sum of squares minus its expectation for pure noise.
#[derive(Clone, Debug)]
pub struct Beyond {
    excess: [f64; 6],
    rows: [f64; 6],
}

impl Beyond {
    /// Computes the residual beyond noise of the model of `round`. The round must have no candidates. Otherwise the
    /// noise would be estimated after a fit of all candidates, which may remove up to half of the noise of the moments.
    pub fn of(round: &Round) -> Beyond {
        let only = |c: usize| std::array::from_fn(|k| k == c);
        Beyond {
            excess: std::array::from_fn(|c| excess(round, &only(c))),
            rows: std::array::from_fn(|c| rows(round, &only(c))),
        }
    }

    /// Returns the share of the residual beyond noise in `channels` that remains after an effect has reduced the
    /// residual sum of squares by `fall`. `None` if the remaining residual is not significant.
    pub fn share(&self, channels: &[usize], fall: f64) -> Option<f64> {
        let own = |of: &[f64; 6]| channels.iter().map(|c| of[*c]).sum::<f64>();
        let (left, rows) = (own(&self.excess), own(&self.rows));
        // the sum of squares of n values of unit white noise has the standard deviation √(2n)
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

/// Number of rows of the regression in `channels`. It equals the expected sum of squares of the whitened noise.
fn rows(round: &Round, channels: &[bool; 6]) -> f64 {
    let all = round.projected.rows_by_channel();
    (0..6).filter(|c| channels[*c]).map(|c| all[c]).sum()
}

/// Combinations of columns whose amplitudes the held-out check fits: each column of a linear candidate, or the whole
/// contribution of a nonlinear candidate. An entry is the index of a column with its weight.
fn directions(trial: &Trial, score: &Score) -> Vec<Vec<(usize, f64)>> {
    match trial.points[score.point].contribution {
        None => score.weights.iter().map(|(c, _)| vec![(*c, 1.0)]).collect(),
        Some(_) => vec![score.weights.clone()],
    }
}

/// Whether the candidate merely replaces changes of existing coefficients.
///
/// Without the candidate, the data move these coefficients far from their prior and thereby explain the residual. With
/// the candidate, the coefficients return to their prior, and the residual hardly becomes smaller.
pub fn absorbs_prior_error(round: &Round, score: &Score) -> bool {
    let prior = &round.projected.prior;
    let last = round.projected.width();
    let linear: f64 = score.weights.iter().map(|(c, w)| w * prior[(*c, last)]).sum();
    let reduction = 2.0 * linear - quadratic(&score.weights, &score.weights, prior);
    reduction > PRIOR_MISFIT.powi(2) && reduction > PRIOR_SHARE * score.fall
}

/// Correlation of the fitted contributions of two candidates after the nuisance parameters are projected out.
pub fn correlation(round: &Round, a: &Score, b: &Score) -> f64 {
    let total = &round.projected.total;
    let of = |u: &Score, v: &Score| quadratic(&u.weights, &v.weights, total);
    of(a, b) / (of(a, a) * of(b, b)).sqrt()
}

/// Indices in `scores` of the effects that these data cannot distinguish from the effect at index `of`.
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

/// Share of `count` block bootstraps in which a candidate of `class` ranks first among the candidates `open`.
///
/// `open` is in descending order of rank. Blocks are drawn separately for each flight.
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

/// Estimates of the free coefficients of an effect from each flight alone.
///
/// Returns one entry for each free coefficient: its index among the coefficients of the effect, then the estimate and
/// its standard deviation for each flight. Both are NaN for a flight without information.
///
/// Sensor errors are estimated again for each flight. The model's coefficients have the estimates from all flights as
/// priors. Without these priors, noise in the regressors of a flight with little excitation would bias the coefficients
/// toward zero (errors in variables).
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

/// Estimates and standard deviations of the free coefficients from one flight. `None` if they cannot be computed.
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
    // a residual beyond noise, for example due to another missing effect, may bias the estimate: its standard deviation
    // is increased
    let misfit = misfit(&p, &trial.channels, found.fall);
    let each: Vec<[f64; 2]> =
        indices.iter().map(|i| [found.values[*i], misfit * found.deviations[*i]]).collect();
    if contribution.is_some() {
        return Some(each);
    }
    // noise in the regressors looks like excitation but contains no information: its part of the Gram matrix is
    // subtracted
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

/// Root mean square of the whitened residual in `channels` after its sum of squares has been reduced by `fall`. The
/// result is at least 1, the value for pure noise.
fn misfit(p: &Projected, channels: &[bool; 6], fall: f64) -> f64 {
    let own = |of: &[(f64, usize); 6]| (0..6).filter(|c| channels[*c]).map(|c| of[c]).collect();
    let all: Vec<Vec<(f64, usize)>> = p.by_channel.iter().map(own).collect();
    let square: f64 = all.iter().flatten().map(|(square, _)| square).sum();
    let rows: usize = all.iter().flatten().map(|(_, rows)| rows).sum();
    ((square - fall) / rows.max(1) as f64).max(1.0).sqrt()
}

/// Nuisance parameters for the fit to one flight. The prior of each model coefficient is its estimate from all flights,
/// fitted together with the effect of `score`.
fn together(round: &Round, score: &Score) -> Vec<Known> {
    let p = &round.projected;
    let mut all = round.known.clone();
    for (k, known) in all.iter_mut().take(round.coefficients.len()).enumerate() {
        let given: f64 = score.weights.iter().map(|(c, w)| w * p.taken[(k, *c)]).sum();
        // the change that the effect causes has the relative standard deviation of the effect itself, 1 / √wald
        let astray = given.powi(2) / score.wald.max(1.0);
        known.offset = p.tuned[k] - given;
        known.width = (p.covariance[(k, k)].max(0.0) + astray).sqrt().min(known.width);
    }
    all
}

/// Columns of one flight: those of the `na` nuisance parameters, then the candidate's columns `columns`, renumbered
/// from `na`. The lists of all other flights are empty.
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

/// Columns of `a` minus the columns of `b` with the same indices, by flight.
fn less(a: &[Placed], b: &[Placed]) -> Vec<Placed> {
    let of = |(a, b): (&Placed, &Placed)| {
        let both = a.iter().filter_map(|(p, x)| Some((*p, x, &b.iter().find(|(q, _)| q == p)?.1)));
        both.map(|(p, x, y)| (p, combine(&[x.clone(), y.clone()], &[1.0, -1.0]))).collect()
    };
    a.iter().zip(b).map(of).collect()
}

/// Whether a flight contradicts `value`, the estimate from all flights. `flights` holds the estimate and standard
/// deviation of each flight.
///
/// An estimate contradicts `value` if it has the opposite sign by more than three standard deviations. It also
/// contradicts if it differs by more than four standard deviations and by more than half of `value`.
pub fn contradict(value: f64, flights: &[[f64; 2]]) -> bool {
    flights.iter().any(|[own, sd]| {
        let other_sign = own * value < 0.0 && own.abs() > 3.0 * sd;
        let off = (own - value).abs();
        other_sign || (off > 4.0 * sd && off > 0.5 * value.abs())
    })
}
