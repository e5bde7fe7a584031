//! Forward selection. A candidate is a physical effect that the model may lack. The candidate with the most evidence is added to
//! the model if it passes the checks. The search is then repeated with the new model until no candidate passes. Candidates that
//! fail a check are refused. A round is one such search, with the model linearised over the flights.

mod examine;
mod found;
mod judge;
mod run_off;

pub use examine::HELD_OUT;
pub use examine::SELECTED;
pub use found::Found;
pub use found::Selected;

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::options::Options;
use crate::diagnose::regression::catalogue::{self, Entry};
use crate::diagnose::regression::rank::Score;
use crate::diagnose::search::coarser::left_by_sums;
use crate::diagnose::search::remainder::remainder;
use crate::diagnose::search::round::{Problem, Round};
use crate::diagnose::search::settling::{Ranked, SETTLING, ranked};
use crate::diagnose::search::shape::shape;
use crate::diagnose::search::unexplained::unexplained;
use crate::diagnose::search::{checks, excitation};
use crate::progress::{Cancelled, FirstLook, Progress, Stage, not_cancelled, report};
use examine::examine;
use greylag_model::{GreyBox, RUDDER};
use run_off::run_off;

/// Fraction of the progress bar that is reached after the first ranking of the candidates.
const RANKED: f64 = 0.3;
/// Largest number of effects added to the model.
const MOST: usize = 6;
/// Largest number of passes in which all coefficients are re-estimated after an effect has been added. The linearised estimates
/// converge slowly, and need more passes than [`SETTLING`], if two coefficients multiply each other (for example a saturation
/// limit and an effectiveness).
const MOST_SETTLING: usize = 12;
/// Convergence tolerance of the re-estimation: largest change of a coefficient in one pass, in its standard deviations.
const STEP_TOLERANCE: f64 = 0.2;
/// Largest number of refused candidates that are set aside while the search continues. The next refusal ends the search.
const MOST_ASIDE: usize = 4;

/// Searches for the effects that `model` lacks, and tests each one before it is added.
///
/// # Errors
/// If the model cannot be evaluated over the flights, or `progress` cancelled.
pub fn search(
    problem: &Problem,
    model: &GreyBox,
    options: &Options,
    progress: &Progress,
) -> Result<Found, DiagnoseError> {
    let round = |model: GreyBox, entries: &[Entry]| {
        let unusable = || DiagnoseError::Unusable { model: model.name.clone() };
        Round::new(problem, model.clone(), entries).ok_or_else(unusable)
    };
    report(progress, "tuning the model's own coefficients", 0.0)?;
    let tuned = round(model.clone(), &[])?.tuned();
    let mut entries = catalogue::candidates(model, &options.with, &options.without);
    if !excitation::moves_rudder(&problem.flights) {
        entries.retain(|e| e.about.id != RUDDER);
    }
    report(progress, &format!("ranking {} candidate effects", entries.len()), 0.05)?;
    let shape = shape(&round(tuned.clone(), &[])?, options.nulls);
    let Ranked { round: first, scores, nulls, threshold } =
        ranked(problem, round(tuned, &entries)?, options);
    let ranking = first_look(&first, &scores, threshold);
    let doing = "checking the best candidate";
    not_cancelled(progress(Stage { doing, fraction: RANKED, ranking: &ranking }))?;
    let first_remainder = remainder(&first, options.nulls, options.level);
    let mut found = Found {
        unexplained: unexplained(&first, &first.tuned_residual()),
        remainder: first_remainder.clone(),
        first,
        first_remainder,
        last: None,
        beyond: None,
        shape,
        scores,
        nulls,
        threshold,
        beaten: Vec::new(),
        level: Vec::new(),
        selected: Vec::new(),
        sums: Vec::new(),
    };
    let mut aside = latest(select(problem, model, &mut found, &entries, options, progress)?);
    found.judge_remainder();
    aside.retain(|s| found.selected.iter().all(|other| other.id != s.id));
    found.selected.append(&mut aside);
    if found.last.is_some() {
        found.sums = left_by_sums(problem, found.round());
    }
    Ok(found)
}

/// Adds the best candidates one by one until none passes the checks. Returns the refused candidates that were set
/// aside.
fn select(
    problem: &Problem,
    model: &GreyBox,
    found: &mut Found,
    entries: &[Entry],
    options: &Options,
    progress: &Progress,
) -> Result<Vec<Selected>, DiagnoseError> {
    let mut aside = Vec::new();
    while found.selected.len() < MOST {
        found.beaten.clear();
        found.level.clear();
        run_off(problem, found);
        report(progress, "checking the best candidate", found.fraction())?;
        let Some(winner) = examine(found, options) else { break };
        let passed = winner.refused.is_empty() || winner.trace.is_some();
        let outcome = match (&winner.trace, passed) {
            (Some(_), _) => "significant but immaterial, added",
            (None, true) => "added",
            (None, false) => "refused",
        };
        report(progress, &format!("{}: {outcome}", winner.id), found.fraction())?;
        // While no effect has been added, the first refusal ends the search. Later, up to MOST_ASIDE refused candidates are
        // set aside, because further effects may be missing.
        if !passed && found.last.is_some() && aside.len() < MOST_ASIDE {
            found.scores.remove(0);
            aside.push(winner);
            continue;
        }
        aside.retain(|s: &Selected| s.id != winner.id);
        found.selected.push(winner);
        if !passed || !found.join(problem, model, entries, options, progress)? {
            break;
        }
    }
    Ok(aside)
}

/// Keeps only the last record of each effect in `refused`. A candidate that was set aside is ranked again after another effect
/// has been added, and may be refused again.
fn latest(refused: Vec<Selected>) -> Vec<Selected> {
    let mut kept: Vec<Selected> = Vec::new();
    for one in refused {
        kept.retain(|s| s.id != one.id);
        kept.push(one);
    }
    kept
}

/// Summary of the first ranking, for progress reports.
fn first_look(round: &Round, scores: &[(usize, Score)], threshold: f64) -> Vec<FirstLook> {
    let of = |(trial, score): &(usize, Score)| FirstLook {
        id: round.trials[*trial].id,
        evidence: score.evidence,
        threshold,
    };
    scores.iter().map(of).collect()
}

/// The model `current` without the added effect `id`. `given` is the model before any effect was added.
fn without(given: &GreyBox, current: &GreyBox, id: &str) -> GreyBox {
    let mut model = given.clone();
    let joined: Vec<&'static str> =
        current.effects().map(|e| e.id).filter(|e| *e != id && !given.has(e)).collect();
    let own = |effect: &str| -> Vec<f64> {
        let prefix = format!("{effect}.");
        let of = current.coefficients().iter().filter(|c| c.name.starts_with(&prefix));
        of.map(|c| c.value).collect()
    };
    for effect in joined {
        // these values were valid in `current`, so the effect can be added
        let _ = model.join(effect, &own(effect));
    }
    for c in current.coefficients().iter().filter(|c| {
        // coefficients that the removed effect had replaced keep the values of the given model
        current.replaced(&c.name) != Some(id)
    }) {
        model.set_coefficient(&c.name, c.value);
    }
    model
}

impl Found {
    /// Adds the effect that was selected last to the model and ranks the remaining candidates. If an earlier effect becomes
    /// insignificant, it is removed. Returns `false`, which ends the search, if the effect cannot be added or if the model with
    /// it cannot be linearised.
    fn join(
        &mut self,
        problem: &Problem,
        given: &GreyBox,
        entries: &[Entry],
        options: &Options,
        progress: &Progress,
    ) -> Result<bool, Cancelled> {
        let Some(winner) = self.selected.last().cloned() else { return Ok(false) };
        let mut model = self.round().with(&winner.score);
        if model.join_most(winner.id, &winner.score.values).is_err() {
            return Ok(false);
        }
        let doing = format!("settling the model with {}", winner.id);
        let Some(settled) = self.settle(problem, given, model, &doing, progress)? else {
            return Ok(false);
        };
        model = settled.model.clone();
        self.beyond = Some(checks::Beyond::of(&settled));
        self.shape = shape(&settled, options.nulls);
        let open: Vec<Entry> = entries.iter().filter(|e| !model.has(e.about.id)).copied().collect();
        report(
            progress,
            &format!("ranking {} candidate effects again", open.len()),
            self.fraction(),
        )?;
        let Some(round) = Round::new(problem, model, &open) else { return Ok(false) };
        let Ranked { round, scores, threshold, .. } = ranked(problem, round, options);
        (self.scores, self.threshold) = (scores, threshold);
        self.remainder = remainder(&round, options.nulls, options.level);
        self.last = Some(round);
        Ok(true)
    }

    /// Re-estimates the coefficients of `model`, which contains the effect that was selected last, until convergence or for at
    /// most `MOST_SETTLING` passes. If an earlier effect becomes insignificant, it is removed, and the passes end. Returns a
    /// round of the resulting model, without candidates; `None` if the model cannot be linearised.
    fn settle(
        &mut self,
        problem: &Problem,
        given: &GreyBox,
        mut model: GreyBox,
        doing: &str,
        progress: &Progress,
    ) -> Result<Option<Round>, Cancelled> {
        let newest = self.selected.last().map(|s| s.id);
        for pass in 0..MOST_SETTLING {
            report(progress, doing, self.fraction())?;
            let Some(round) = Round::new(problem, model.clone(), &[]) else { return Ok(None) };
            if pass >= SETTLING && round.stride() < STEP_TOLERANCE {
                return Ok(Some(round));
            }
            model = round.tuned();
            let idle = self.selected.iter().find(|s| {
                Some(s.id) != newest && round.amount(s.id).is_some_and(|wald| wald < self.threshold)
            });
            if let Some(idle) = idle.map(|s| s.id) {
                model = without(given, &model, idle);
                self.selected.retain(|s| s.id != idle);
                break;
            }
        }
        Ok(Round::new(problem, model, &[]))
    }

    /// Estimated fraction of the work that is done, 0 to 1. The number of effects is not known in advance: each selected effect
    /// halves the fraction that is left.
    fn fraction(&self) -> f64 {
        let left = 0.5_f64.powi(self.selected.len() as i32);
        RANKED + (0.9 - RANKED) * (1.0 - left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_that_is_refused_twice_is_listed_once() {
        let refused = |id, threshold| Selected {
            id,
            score: Score {
                evidence: 0.0,
                wald: 0.0,
                order: 0.0,
                fall: 0.0,
                values: Vec::new(),
                deviations: Vec::new(),
                weights: Vec::new(),
                point: 0,
            },
            threshold,
            class: Vec::new(),
            heldout: f64::NAN,
            selected: 0.0,
            by_flight: Vec::new(),
            channels: Vec::new(),
            taken: [0.0; 6],
            refused: vec!["the flights contradict one another".into()],
            slight: false,
            trace: None,
            absorbs_prior_error: false,
            curved: false,
            contribution: Vec::new(),
        };
        let kept = latest(vec![refused("a", 1.0), refused("b", 1.0), refused("a", 2.0)]);
        let kept: Vec<(&str, f64)> = kept.iter().map(|s| (s.id, s.threshold)).collect();
        assert_eq!(kept, [("b", 1.0), ("a", 2.0)]);
    }
}
