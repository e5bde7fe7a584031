//! Decides between candidates (physical effects that the model may lack) with similar scores. Each is added to the model alone,
//! all coefficients are re-estimated, and the remaining errors are compared.

use super::found::Found;
use crate::diagnose::search::checks;
use crate::diagnose::search::round::Problem;
use crate::diagnose::search::settling::{SETTLING, settled};

/// Smallest ranking criterion (`Score::order`) of a contender, a candidate that is compared in this way, as a share of the
/// best candidate's criterion.
const CONTENDING: f64 = 0.2;
/// Smallest magnitude of the correlation between the fitted contributions of a contender and of the best candidate.
const CONTENDING_CORRELATION: f64 = 0.6;
/// Largest number of contenders, the best candidate included.
const CONTENDERS: usize = 4;

/// Compares the contenders. The linearisation about the model without them cannot distinguish them. The noise estimate is
/// the same for all.
///
/// The best contender moves to the first place of the ranking. The others are recorded as clearly worse or as equally
/// good. Returns `None` and changes nothing if there are fewer than two contenders, or if the evidence of the best candidate
/// is below the threshold.
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
                && checks::correlation(round, best, score).abs() > CONTENDING_CORRELATION
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
    if least.is_infinite() {
        return None;
    }
    let others = errors.iter().filter(|(k, _)| *k != winner);
    let (beaten, level): (Vec<_>, Vec<_>) = others.partition(|(_, e)| *e > least + checks::CLOSE);
    let trials = |of: Vec<&(usize, f64)>| of.iter().map(|(k, _)| found.scores[*k].0).collect();
    let (beaten, level) = (trials(beaten), trials(level));
    let first = found.scores.remove(winner);
    found.scores.insert(0, first);
    (found.beaten, found.level) = (beaten, level);
    Some(())
}
