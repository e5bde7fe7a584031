//! Test whether misaligned axes of the sensors explain the residual better than missing effects (physical contributions to forces
//! and moments).
//!
//! Example: the board with the sensors is mounted with a pitch of 3°. Then part of every roll appears as yaw, as with a product
//! of inertia. Part of the lift appears as drag. The flight-path reconstruction cannot show the misalignment, because all
//! quantities that the board measures rotate equally. The test therefore uses the aerodynamics. If the model is not adequate, the
//! search is repeated with free misalignment angles. The Bayesian information criterion compares both explanations under the same
//! noise: their residuals and their numbers of constants.

use crate::diagnose::answer::per_flight::further_angles;
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
/// The second search is made only if the angles reduce the residual by at least this share of the best effect's
/// reduction. With several selected effects any reduction beyond chance suffices: beside a strong effect, such as a rate limit,
/// the board's angles may explain a weaker one.
const WORTH: f64 = 0.3;

/// Largest misalignment for which a regression that is linear in the angles suffices, rad.
const LINEAR: f64 = std::f64::consts::PI / 180.0;
/// Largest number of searches with axes that are rotated back.
const AGAIN: usize = 2;

/// Returns the better explanation of the flights of `problem`: `found`, or a search result with misaligned axes. If
/// both are equally good, the effects of `found` are marked as indistinguishable from misaligned axes.
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
    let cost = |problem: &Problem, of: &Found| cost(problem, &found, of);
    let mut tilted = tilted;
    let mut other = search(&tilted, model, options, &part(progress, [0.9, 0.93]))?;
    for _ in 0..AGAIN {
        let Some(next) = turned_back(&tilted, &other) else { break };
        let again = search(&next, model, options, &part(progress, [0.93, 0.95]))?;
        let better = matches!((cost(&tilted, &other), cost(&next, &again)), (Some(now), Some(then)) if then < now);
        if !better {
            break;
        }
        (tilted, other) = (next, again);
    }
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

/// The problem with its axes rotated back by the angles in `found`. `None` if these are small or the model is adequate with them.
///
/// The regression is linear in the angles. Beyond a degree or two the aerodynamics is not: the lift of an aircraft near its stall
/// changes within that.
fn turned_back(problem: &Problem, found: &Found) -> Option<Problem> {
    let angles = further_angles(found.round());
    let large = angles.iter().flatten().any(|angle| angle.abs() > LINEAR);
    (large && verdict(found) != Verdict::Adequate).then(|| {
        let pairs = problem.flights.iter().zip(&angles);
        let flights = pairs.map(|(flight, angles)| flight.turned_back(angles)).collect();
        Problem { flights, ..problem.clone() }
    })
}

/// Returns the problem with free misalignment angles. `None` if the angles are free already, if no effect is missing,
/// or if the angles remove too little of the residual.
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
    let enough = found.selected.len() > 1 || taken > WORTH * best;
    (enough && taken > found.threshold).then_some(tilted)
}

/// Sum of squares of the whitened residual of `round`.
fn left(round: &Round) -> f64 {
    let last = round.projected.width();
    round.projected.total[(last, last)]
}

/// Bayesian information criterion of the result `of`: residual sum of squares with the noise of `first`, plus the
/// penalty for its constants. `None` if the model cannot be linearised.
fn cost(problem: &Problem, first: &Found, of: &Found) -> Option<f64> {
    let model = of.round().tuned();
    let given = of.first.model.coefficients().len();
    let constants =
        model.coefficients().len() - given + problem.per_flight.angles() * problem.flights.len();
    let (_, left) = settled(problem, &first.first, model, 1 + SETTLING)?;
    let rows: usize = first.first.cells.list.iter().map(|cell| cell.windows.len()).sum();
    Some(left + constants as f64 * (rows.max(2) as f64).ln())
}
