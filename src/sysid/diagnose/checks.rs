//! What an effect must pass besides its evidence: held-out segments, bootstraps, the flights' agreement.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;
use rayon::prelude::*;

use super::projected::scaled_inverse;
use super::rank::{Draw, Score, Trial, quadratic};
use super::round::Round;
use crate::num::stream::stream;

/// Folds of the held-out segments.
const FOLDS: usize = 5;
/// Random stream of the bootstraps.
const BOOTSTRAPS: u64 = 82;
/// Contributions that correlate more than this cannot be told apart.
pub const ALIKE: f64 = 0.9;
/// Nor those whose evidence is this close.
pub const CLOSE: f64 = 10.0;
/// Candidates that a bootstrap lets compete.
const COMPETING: usize = 8;

/// Share of the squared error beyond noise that `score` takes from segments that its amounts were not
/// fitted on; segments of a block's length, every fifth one held out in turn, in the channels in which
/// the candidate acts.
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

/// Squared whitened error beyond noise in `channels`.
pub fn excess(round: &Round, channels: &[bool; 6]) -> f64 {
    let blocks = round.projected.by_channel.iter();
    let of = |sums: &[(f64, usize); 6]| {
        (0..6).filter(|c| channels[*c]).map(|c| sums[c].0 - sums[c].1 as f64).sum::<f64>()
    };
    blocks.map(of).sum()
}

/// What may be scaled in a contribution: each column of a linear candidate, a nonlinear one as a whole.
fn directions(trial: &Trial, score: &Score) -> Vec<Vec<(usize, f64)>> {
    match trial.points[score.point].contribution {
        None => score.weights.iter().map(|(c, _)| vec![(*c, 1.0)]).collect(),
        Some(_) => vec![score.weights.clone()],
    }
}

/// How much the contributions of two scores are alike: the correlation of what they add to the residual.
pub fn likeness(round: &Round, a: &Score, b: &Score) -> f64 {
    let total = &round.projected.total;
    let of = |u: &Score, v: &Score| quadratic(&u.weights, &v.weights, total);
    of(a, b) / (of(a, a) * of(b, b)).sqrt()
}

/// Places in `scores` of those that these data cannot tell from the first one.
pub fn class(round: &Round, scores: &[(usize, Score)], of: usize) -> Vec<usize> {
    let (_, own) = &scores[of];
    (0..scores.len())
        .filter(|k| *k != of)
        .filter(|k| {
            let (trial, other) = &scores[*k];
            other.evidence > own.evidence - CLOSE
                && !round.at_bound(*trial, other)
                && likeness(round, own, other).abs() > ALIKE
        })
        .collect()
}

/// Share of `count` block bootstraps in which one of the trials of `class` comes first among those of `open`,
/// the best ones first; blocks are drawn flight by flight.
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

/// The first free coefficient as each flight alone has it, with its standard deviation; NaN where a flight
/// does not tell.
pub fn by_flight(round: &Round, trial: &Trial, score: &Score) -> Vec<[f64; 2]> {
    let p = &round.projected;
    let last = p.width();
    let point = &trial.points[score.point];
    let columns: Vec<usize> = point.free.iter().map(|f| f.1).collect();
    let first = point.free[0].0;
    // how much more the blocks scatter than the noise alone
    let whole =
        DMatrix::from_fn(columns.len(), columns.len(), |i, j| p.total[(columns[i], columns[j])]);
    let alone = scaled_inverse(&whole).map_or(f64::NAN, |m| m[(0, 0)].sqrt());
    let inflation = (score.deviations[first] / alone).max(1.0);
    (0..round.flights.len())
        .map(|flight| {
            let own = (0..p.blocks.len()).filter(|b| round.cells.flight_of_block[*b] == flight);
            let grams = p.resampled(own);
            let gram = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
                grams.total[(columns[i], columns[j])]
            });
            let product = DVector::from_iterator(
                columns.len(),
                columns.iter().map(|c| {
                    let known: f64 =
                        score.weights.iter().map(|(d, w)| w * grams.total[(*c, *d)]).sum();
                    grams.total[(*c, last)] - known
                }),
            );
            let Some(inverse) = scaled_inverse(&gram) else { return [f64::NAN; 2] };
            let step = &inverse * product;
            [score.values[first] + step[0], inflation * inverse[(0, 0)].max(0.0).sqrt()]
        })
        .collect()
}

/// Whether flights contradict the common `value`: the other sign beyond doubt, or another amount beyond
/// doubt and by half.
pub fn contradict(value: f64, flights: &[[f64; 2]]) -> bool {
    flights.iter().any(|[own, sd]| {
        let other_sign = own * value < 0.0 && own.abs() > 3.0 * sd;
        let off = (own - value).abs();
        other_sign || (off > 4.0 * sd && off > 0.5 * value.abs())
    })
}
