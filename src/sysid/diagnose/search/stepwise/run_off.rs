//! The run-off of close contenders, each joined to the model and settled.

use super::found::Found;
use crate::diagnose::search::checks;
use crate::diagnose::search::round::Problem;
use crate::diagnose::search::settling::{SETTLING, settled};

/// Share of the best candidate's order (see `Score::order`) above which another contends with it.
const CONTENDING: f64 = 0.2;
/// Least likeness (correlation) of its contribution to the best one's.
const CONTENDING_LIKENESS: f64 = 0.6;
/// Most contenders, the best one among them.
const CONTENDERS: usize = 4;

/// Puts the best of several close contenders first, each joined to the model and settled under one noise, and
/// tells those that lose clearly from those that are as good: a linearisation at the model without them does
/// not tell them apart.
pub(super) fn run_off(problem: &Problem, found: &mut Found) -> Option<()> {
    let round = found.last.as_ref().unwrap_or(&found.first);
    let (_, best) = found.scores.first()?;
    if best.evidence < found.threshold {
        return None;
    }
    let contend: Vec<usize> = (0..found.scores.len())
        .filter(|k| {
            let (trial, score) = &found.scores[*k];
            score.order > CONTENDING * best.order
                && !round.at_bound(*trial, score)
                && checks::likeness(round, best, score).abs() > CONTENDING_LIKENESS
        })
        .take(CONTENDERS)
        .collect();
    if contend.len() < 2 {
        return None;
    }
    let error = |k: &usize| {
        let (trial, score) = &found.scores[*k];
        let mut model = round.with(score);
        model.join_most(round.trials[*trial].id, &score.values).ok()?;
        Some(settled(problem, round, model, 1 + SETTLING)?.1)
    };
    let errors: Vec<(usize, f64)> =
        contend.iter().map(|k| (*k, error(k).unwrap_or(f64::INFINITY))).collect();
    let (winner, least) = *errors.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let others = errors.iter().filter(|(k, _)| *k != winner);
    let (beaten, level): (Vec<_>, Vec<_>) = others.partition(|(_, e)| *e > least + checks::CLOSE);
    let trials = |of: Vec<&(usize, f64)>| of.iter().map(|(k, _)| found.scores[*k].0).collect();
    let (beaten, level) = (trials(beaten), trials(level));
    let first = found.scores.remove(winner);
    found.scores.insert(0, first);
    (found.beaten, found.level) = (beaten, level);
    Some(())
}
