//! Measured axes that stand askew as a rival of missing effects: what explains the flights better stands.
//!
//! A board that is pitched by 3° makes of every roll a yaw, as a product of inertia does, and of lift a part of drag. No
//! kinematics shows it, for all that the board measures is turned alike. So it is judged where the aerodynamics are: once
//! effects were found, the flights are explained anew with the angles of their axes free, under the same noise, and both
//! explanations are compared by what they leave and by how many constants they need (Bayesian information criterion).

use crate::diagnose::answer::result::Verdict;
use crate::diagnose::answer::run::verdict;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::options::Options;
use crate::diagnose::search::checks::CLOSE;
use crate::diagnose::search::round::{Beside, Problem, Round};
use crate::diagnose::search::settling::{SETTLING, settled};
use crate::diagnose::search::stepwise::{Found, search};
use crate::per_flight::{PerFlight, askew};
use crate::progress::{Progress, part, say};
use greylag_model::GreyBox;

/// Standard deviation of each angle before the flights are seen, °: a board mounted by eye.
const MOUNTED_DEG: f64 = 3.0;
/// Least share of what the best effect takes that the angles must take to be worth a search.
const WORTH: f64 = 0.3;

/// The better explanation of the flights of `problem`: `found`, or one with turned axes. Where both are as good, the
/// effects of `found` can then not be told from turned axes, and say so.
///
/// # Errors
/// As [`search`].
pub fn against_axes(
    problem: Problem,
    model: &GreyBox,
    options: &Options,
    progress: &Progress,
    mut found: Found,
) -> Result<Found, DiagnoseError> {
    let Some(tilted) = worth(&problem, &found) else { return Ok(found) };
    say(progress, "explaining the flights by axes that stand askew", 0.9)?;
    let other = search(&tilted, model, options, &part(progress, [0.9, 0.95]))?;
    let cost = |problem: &Problem, of: &Found| cost(problem, &found, of);
    let (Some(effects), Some(axes)) = (cost(&problem, &found), cost(&tilted, &other)) else {
        return Ok(found);
    };
    if effects - axes > CLOSE {
        return Ok(other);
    }
    if axes - effects < CLOSE && verdict(&other) != Verdict::Effect {
        for effect in found.selected.iter_mut().filter(|s| s.refused.is_empty()) {
            effect.class.push(askew::ID.into());
        }
    }
    Ok(found)
}

/// The problem with the angles free, if something is missing and they take a fair part of it.
fn worth(problem: &Problem, found: &Found) -> Option<Problem> {
    if problem.per_flight.askew_deg.is_some() || verdict(found) == Verdict::Adequate {
        return None;
    }
    let per_flight = PerFlight { askew_deg: Some(MOUNTED_DEG), ..problem.per_flight };
    let tilted = Problem { per_flight, ..problem.clone() };
    let first = &found.first;
    let beside = Beside { noise: Some(&first.noise), ..Beside::default() };
    let turned = Round::beside(&tilted, first.model.clone(), &[], beside)?;
    let taken = left(first) - left(&turned);
    let best = found.selected.first().map(|s| s.score.fall);
    let best = best.or(found.scores.first().map(|(_, s)| s.fall)).unwrap_or(0.0);
    (taken > WORTH * best && taken > found.threshold).then_some(tilted)
}

/// The squared whitened error that `round` leaves.
fn left(round: &Round) -> f64 {
    let last = round.projected.width();
    round.projected.total[(last, last)]
}

/// What `of` leaves under the noise of `first`, with what its constants cost.
fn cost(problem: &Problem, first: &Found, of: &Found) -> Option<f64> {
    let model = of.round().tuned();
    let given = of.first.model.coefficients().len();
    let constants =
        model.coefficients().len() - given + problem.per_flight.angles() * problem.flights.len();
    let (_, left) = settled(problem, &first.first, model, 1 + SETTLING)?;
    let rows: usize = first.first.cells.list.iter().map(|cell| cell.windows.len()).sum();
    Some(left + constants as f64 * (rows.max(2) as f64).ln())
}
