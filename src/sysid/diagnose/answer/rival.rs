//! Misaligned measured axes as a rival explanation of the residual.
//!
//! A board pitched by 3° turns part of every roll into yaw, as a product of inertia does, and part of lift into drag.
//! Kinematics cannot show the misalignment, because it rotates all quantities that the board measures equally. It is
//! therefore tested with the aerodynamics. After effects were found, the search is repeated with free misalignment
//! angles and the same noise. The Bayesian information criterion compares both explanations: their residuals and their
//! numbers of constants.

use crate::diagnose::answer::result::Verdict;
use crate::diagnose::answer::run::verdict;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::options::Options;
use crate::diagnose::search::checks::CLOSE;
use crate::diagnose::search::round::{Beside, Problem, Round};
use crate::diagnose::search::settling::{SETTLING, settled};
use crate::diagnose::search::stepwise::{Found, search};
use crate::per_flight::{PerFlight, askew};
use crate::progress::{Progress, part, report};
use greylag_model::GreyBox;

/// Prior standard deviation of each misalignment angle, °: a board mounted by eye.
const MOUNTED_DEG: f64 = 3.0;
/// The second search is made only if the angles remove at least this share of the error that the best effect removes.
const WORTH: f64 = 0.3;

/// The better explanation of the flights of `problem`: `found`, or one with misaligned axes. If both are equally
/// good, the effects of `found` are marked as indistinguishable from misaligned axes.
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
    report(progress, "explaining the flights by misaligned axes", 0.9)?;
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

/// The problem with free misalignment angles. `None` if no effect is missing or if the angles remove too little of the
/// residual.
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

/// Sum of squares of the whitened residual of `round`.
fn left(round: &Round) -> f64 {
    let last = round.projected.width();
    round.projected.total[(last, last)]
}

/// Sum of squares that `of` leaves under the noise of `first`, plus the penalty of its constants.
fn cost(problem: &Problem, first: &Found, of: &Found) -> Option<f64> {
    let model = of.round().tuned();
    let given = of.first.model.coefficients().len();
    let constants =
        model.coefficients().len() - given + problem.per_flight.angles() * problem.flights.len();
    let (_, left) = settled(problem, &first.first, model, 1 + SETTLING)?;
    let rows: usize = first.first.cells.list.iter().map(|cell| cell.windows.len()).sum();
    Some(left + constants as f64 * (rows.max(2) as f64).ln())
}
