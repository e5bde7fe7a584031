//! Checks of an effect in addition to its evidence: held-out segments, bootstraps, agreement of the flights.
//!
//! The thresholds of the checks are in `stepwise/examine.rs` and `stepwise/judge.rs`.

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

/// Number of folds of the held-out segments.
const FOLDS: usize = 5;
/// Number of the random stream for the bootstraps.
const BOOTSTRAPS: u64 = 82;
/// Magnitude of the correlation above which contributions cannot be distinguished.
pub const ALIKE: f64 = 0.9;
/// Difference of evidence below which effects cannot be distinguished.
pub const CLOSE: f64 = 10.0;
/// Uncertainty of the noise level, as squared whitened error per row. Without a missing effect, the error beyond noise was
/// −0.03 to 0.07.
const UNSURE: f64 = 0.1;
/// Number of standard deviations of the squared noise above which a remaining residual is significant.
const DOUBT: f64 = 4.0;
/// Smallest share of a flight's information on a coefficient that is due to excitation, not to noise in the columns.
const LEAST_SIGNAL: f64 = 0.5;
/// Reduction of the prior's misfit, in prior standard deviations, above which a candidate may only replace an adjustment of
/// existing coefficients.
const PRIOR_MISFIT: f64 = 5.0;
/// Share of prior misfit in a candidate's reduction above which the candidate counts as such a replacement.
const PRIOR_SHARE: f64 = 0.9;
/// Number of candidates that are compared in a bootstrap.
const COMPETING: usize = 8;

/// Share of the squared error beyond noise that the candidate removes from held-out blocks, in the channels in which it acts.
///
/// Every fifth block is held out in turn. The coefficients are fitted to the other blocks. NaN if this fit is singular.
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

/// Squared whitened error of a model beyond noise, by channel.
#[derive(Clone, Debug)]
pub struct Beyond {
    excess: [f64; 6],
    rows: [f64; 6],
}

impl Beyond {
    /// The error of the model of `round`. The round must have no candidates: a fit with the columns of all candidates follows
    /// the noise, of which as little as half may remain in the moments.
    pub fn of(round: &Round) -> Beyond {
        let only = |c: usize| std::array::from_fn(|k| k == c);
        Beyond {
            excess: std::array::from_fn(|c| excess(round, &only(c))),
            rows: std::array::from_fn(|c| rows(round, &only(c))),
        }
    }

    /// Remaining share of the error in `channels` after an effect has removed `fall`. `None` if the remaining error does not
    /// exceed chance.
    pub fn share(&self, channels: &[usize], fall: f64) -> Option<f64> {
        let own = |of: &[f64; 6]| channels.iter().map(|c| of[*c]).sum::<f64>();
        let (left, rows) = (own(&self.excess), own(&self.rows));
        // the sum of n squares of white noise has the standard deviation √(2n)
        let beyond_doubt = left > f64::max(DOUBT * (2.0 * rows).sqrt(), UNSURE * rows);
        beyond_doubt.then(|| left / (left + fall))
    }
}

/// Squared whitened error beyond noise in `channels`.
pub fn excess(round: &Round, channels: &[bool; 6]) -> f64 {
    let blocks = round.projected.by_channel.iter();
    let of = |sums: &[(f64, usize); 6]| -> f64 {
        (0..6).filter(|c| channels[*c]).map(|c| sums[c].0).sum()
    };
    blocks.map(of).sum::<f64>() - rows(round, channels)
}

/// Number of rows in `channels`.
fn rows(round: &Round, channels: &[bool; 6]) -> f64 {
    let all = round.projected.rows_by_channel();
    (0..6).filter(|c| channels[*c]).map(|c| all[c]).sum()
}

/// Directions that are scaled in a contribution: each column of a linear candidate, or the whole contribution of a nonlinear
/// candidate.
fn directions(trial: &Trial, score: &Score) -> Vec<Vec<(usize, f64)>> {
    match trial.points[score.point].contribution {
        None => score.weights.iter().map(|(c, _)| vec![(*c, 1.0)]).collect(),
        Some(_) => vec![score.weights.clone()],
    }
}

/// Whether the candidate mostly replaces an adjustment of existing coefficients.
///
/// The candidate then reduces the prior misfit of coefficients that the data move far from their prior. It hardly reduces the
/// error of the flights, because the adjusted coefficients remove the same error.
pub fn absorbs_prior_error(round: &Round, score: &Score) -> bool {
    let prior = &round.projected.prior;
    let last = round.projected.width();
    let linear: f64 = score.weights.iter().map(|(c, w)| w * prior[(*c, last)]).sum();
    let reduction = 2.0 * linear - quadratic(&score.weights, &score.weights, prior);
    reduction > PRIOR_MISFIT.powi(2) && reduction > PRIOR_SHARE * score.fall
}

/// Correlation of the contributions of two scores to the residual.
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

/// Share of `count` block bootstraps in which a trial of `class` ranks first among the trials of `open`.
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

/// Estimates from each flight alone: for each free coefficient its index among the coefficients of the effect, then by flight its
/// estimate with its standard deviation. NaN for a flight without information.
///
/// Sensor errors are estimated again for each flight. The model's coefficients keep the estimates and standard deviations
/// from all flights. A flight with little excitation could not re-estimate them: noise in its regressors biases coefficients
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

/// Estimates of the free coefficients from one flight, in their order.
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
    // a residual beyond noise, for example due to another missing effect, may bias the estimate: the deviation is raised
    let misfit = misfit(&p, &trial.channels, found.fall);
    let each: Vec<[f64; 2]> =
        indices.iter().map(|i| [found.values[*i], misfit * found.deviations[*i]]).collect();
    if contribution.is_some() {
        return Some(each);
    }
    // sensor noise in the columns resembles excitation but contains no information: its part is subtracted
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

/// Ratio of the residual in `channels`, after a reduction of its square by `fall`, to the noise; at least 1.
fn misfit(p: &Projected, channels: &[bool; 6], fall: f64) -> f64 {
    let own = |of: &[(f64, usize); 6]| (0..6).filter(|c| channels[*c]).map(|c| of[c]).collect();
    let all: Vec<Vec<(f64, usize)>> = p.by_channel.iter().map(own).collect();
    let square: f64 = all.iter().flatten().map(|(square, _)| square).sum();
    let rows: usize = all.iter().flatten().map(|(_, rows)| rows).sum();
    ((square - fall) / rows.max(1) as f64).max(1.0).sqrt()
}

/// Nuisance parameters, with priors of the model's coefficients from their joint estimate with the effect of `score` from all
/// flights.
fn together(round: &Round, score: &Score) -> Vec<Known> {
    let p = &round.projected;
    let mut all = round.known.clone();
    for (k, known) in all.iter_mut().take(round.coefficients.len()).enumerate() {
        let given: f64 = score.weights.iter().map(|(c, w)| w * p.taken[(k, *c)]).sum();
        // the change due to the effect has the same relative standard deviation as the effect, 1 / √wald
        let astray = given.powi(2) / score.wald.max(1.0);
        known.offset = p.tuned[k] - given;
        known.width = (p.covariance[(k, k)].max(0.0) + astray).sqrt().min(known.width);
    }
    all
}

/// Nuisance columns of one flight and its renumbered candidate columns `columns`. The lists of the other flights are empty.
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

/// Columns of `a` less those of `b` at the same indices.
fn less(a: &[Placed], b: &[Placed]) -> Vec<Placed> {
    let of = |(a, b): (&Placed, &Placed)| {
        let both = a.iter().filter_map(|(p, x)| Some((*p, x, &b.iter().find(|(q, _)| q == p)?.1)));
        both.map(|(p, x, y)| (p, combine(&[x.clone(), y.clone()], &[1.0, -1.0]))).collect()
    };
    a.iter().zip(b).map(of).collect()
}

/// Whether a flight contradicts the common `value`. Its estimate then has significantly the opposite sign, or differs
/// significantly and by more than half of `value`. `flights` holds estimates and standard deviations.
pub fn contradict(value: f64, flights: &[[f64; 2]]) -> bool {
    flights.iter().any(|[own, sd]| {
        let other_sign = own * value < 0.0 && own.abs() > 3.0 * sd;
        let off = (own - value).abs();
        other_sign || (off > 4.0 * sd && off > 0.5 * value.abs())
    })
}
