//! Placebo regressors (decoys), which check a diagnosis for false detections. They are made from the regressors of candidates
//! (physical effects that the model may lack), by reversal in time or by randomised phases. They cannot be effects, so they
//! should have little evidence.

use std::f64::consts::TAU;

use rand::RngExt;

use crate::diagnose::answer::result::Decoy;
use crate::diagnose::regression::cells::Placed;
use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::projected::Projected;
use crate::diagnose::regression::rank::{Draw, Point, Trial};
use crate::diagnose::search::round::Round;
use crate::diagnose::search::stepwise::Found;
use greylag_num::stream::{Stream, stream};

/// Number that separates the random stream of the phases from others with the same seed.
const DECOYS: u64 = 84;
/// Largest number of candidates from which placebo regressors are made.
const MOST: usize = 6;
/// Longest series whose phases are randomised at once, in windows (short stretches of flight over which data are averaged).
/// Longer series are divided, to limit the cost of the Fourier transform.
const PIECE: usize = 256;

/// Makes placebo regressors from the best candidates in the last round of the search (the last linearisation of the model), and
/// computes their evidence. Only candidates with a single coefficient are used.
pub fn decoys(found: &Found, seed: u64) -> Vec<Decoy> {
    let round = found.round();
    let mut random = stream(seed, &[DECOYS]);
    let single = |t: &&Trial| t.points.len() == 1 && t.points[0].free.len() == 1;
    let order = found.scores.iter().map(|(k, _)| &round.trials[*k]);
    let trials: Vec<&Trial> = order.filter(single).take(MOST).collect();
    let (mut names, mut lists) = (Vec::new(), vec![Vec::new(); round.flights.len()]);
    for trial in &trials {
        let place = round.known.len() + trial.points[0].free[0].1;
        names.push((format!("{} reversed in time", trial.id), (*trial).clone()));
        names.push((format!("{} with its phases shuffled", trial.id), (*trial).clone()));
        for (list, placed) in lists.iter_mut().zip(&round.placed) {
            let own = placed.iter().find(|(p, _)| *p == place).map(|(_, c)| c.clone());
            let own = own.unwrap_or_default();
            let reversed: Column = own.clone().map(|x| x.into_iter().rev().collect());
            let shuffled: Column = own.map(|x| shuffle(&x, &mut random));
            list.extend([reversed, shuffled]);
        }
    }
    evidence(round, &names, &lists)
}

fn evidence(round: &Round, names: &[(String, Trial)], lists: &[Vec<Column>]) -> Vec<Decoy> {
    let na = round.known.len();
    let last = na + names.len();
    let placed: Vec<Placed> = round
        .placed
        .iter()
        .zip(lists)
        .map(|(old, decoys)| {
            let known = old.iter().take_while(|(p, _)| *p < na).cloned();
            let own = decoys.iter().cloned().enumerate().map(|(k, c)| (na + k, c));
            let residual = old.iter().filter(|(p, _)| *p == round.last);
            known.chain(own).chain(residual.map(|(_, c)| (last, c.clone()))).collect()
        })
        .collect();
    let Some(p) = Projected::new(
        &round.cells,
        &placed,
        last,
        &round.known,
        &round.noise,
        &round.shared()[..na],
    ) else {
        return Vec::new();
    };
    let grams = p.grams();
    let draw = Draw::measured(&grams);
    let of = |(k, (name, trial)): (usize, &(String, Trial))| {
        let anything = [f64::NEG_INFINITY, f64::INFINITY];
        let point = Point { values: vec![0.0], contribution: None, free: vec![(0, k, anything)] };
        let trial = Trial { points: vec![point], ..trial.clone() };
        Some(Decoy { name: name.clone(), evidence: trial.score(&grams, &draw)?.evidence })
    };
    names.iter().enumerate().filter_map(of).collect()
}

/// A series with the amplitude spectrum of `x` and random phases, made piece by piece.
fn shuffle(x: &[f64], random: &mut Stream) -> Vec<f64> {
    x.chunks(PIECE).flat_map(|piece| shuffle_piece(piece, random)).collect()
}

fn shuffle_piece(x: &[f64], random: &mut Stream) -> Vec<f64> {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n.max(1.0);
    let mut out = vec![mean; x.len()];
    for frequency in 1..=x.len() / 2 {
        let at = |k: usize| TAU * (frequency * k % x.len()) as f64 / n;
        let (mut real, mut imaginary) = (0.0, 0.0);
        for (k, value) in x.iter().enumerate() {
            real += value * at(k).cos();
            imaginary += value * at(k).sin();
        }
        let twice = if 2 * frequency == x.len() { 1.0 } else { 2.0 };
        let size = twice * real.hypot(imaginary) / n;
        let phase = TAU * random.random::<f64>();
        out.iter_mut().enumerate().for_each(|(k, y)| *y += size * (at(k) + phase).cos());
    }
    out
}
