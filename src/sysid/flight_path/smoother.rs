//! The smoother: the path and the constants that fit all sensors best, by Gauss–Newton.
//!
//! First gusts are noise of the sensors of the air, with which motion and constants are fitted. Where the
//! data find gusts likelier, the air then gusts along the path, the constants held; what gusts of that
//! level may have done to the constants goes into their deviations. To seek path, gusts and constants
//! together would find an airspeed scale far above one, for it makes every gust smaller.

use nalgebra::Vector3;

use crate::flight_path::ReconstructError;
use crate::flight_path::equations::{Found, Problem, Solved, no_path};
use crate::flight_path::gusts;
use crate::flight_path::kinematics::MOTION;
use crate::flight_path::levels::{CALM, Levels};
use crate::flight_path::nuisance::WIND;
use crate::flight_path::path::Path;

/// Levels of gusts that are tried, m/s, then the factors around the best of them.
const COARSE: [f64; 4] = [0.02, 0.1, 0.5, 2.0];
const FINE: [f64; 3] = [2.0, 1.4, 1.2];
/// Residuals beyond this many standard deviations count less.
const BOUND: f64 = 4.0;
/// Iterations with gusts.
const GUSTY: usize = 4;
/// Iterations before levels are taken from residuals, and in all.
const FIRST: usize = 2;
const LAST: usize = 25;
/// The fit has settled where no constant moves by more than this part of its deviation, and no level
/// by more than that part of itself.
const SETTLED: f64 = 0.05;
const LEVEL_SETTLED: f64 = 0.02;
/// Least part of a step that is tried.
const LEAST_PART: f64 = 1.0 / 64.0;

/// Smooths all stretches of the log together.
///
/// # Errors
/// [`ReconstructError::NoPath`] if the search does not settle on numbers.
pub fn smooth(problem: &Problem) -> Result<Found, ReconstructError> {
    let Problem { log, options, means, widths, .. } = *problem;
    let singular = || no_path(&options.name, "the equations became singular");
    let mut found = Found {
        paths: log.tracks.iter().map(Path::guess).collect(),
        values: means,
        deviations: widths,
        levels: Levels::first(log),
    };
    start(&mut found, problem);
    for iteration in 0..LAST {
        let bound = if iteration < FIRST { f64::INFINITY } else { BOUND };
        let solved = problem.calm(&found, bound).ok_or_else(singular)?;
        let moved = search(problem, &mut found, &solved, bound)?;
        if iteration < FIRST {
            continue;
        }
        let change = found.levels.renew(&solved.readings, log.step);
        let change = change.max(found.levels.loosen(&problem.strain(&found)));
        if iteration > FIRST && moved < SETTLED && change < LEVEL_SETTLED {
            break;
        }
    }
    gusty(problem, &mut found, &singular)?;
    Ok(found)
}

/// Goes the step, or the largest part of it (halved from try to try) that fits the data better; none if there is none.
/// Returns the largest move of a constant in its deviation.
///
/// Without it a flight that is nearly straight, in which wind, airspeed scale and path stand for each other, ends in a wind
/// of 5 m/s that nobody measured: real ArduPlane's first minute did.
fn search(
    problem: &Problem,
    found: &mut Found,
    solved: &Solved<MOTION>,
    bound: f64,
) -> Result<f64, ReconstructError> {
    let before = problem.merit(found, bound);
    let mut part = 1.0;
    while part >= LEAST_PART {
        let mut trial = found.clone();
        let moved = solved.apply(&mut trial, part, &problem.options.name)?;
        if problem.merit(&trial, bound) <= before {
            *found = trial;
            return Ok(moved);
        }
        part *= 0.5;
    }
    found.deviations = solved.deviations;
    Ok(0.0)
}

/// Lets the air gust along the path where the data find that likelier.
fn gusty(
    problem: &Problem,
    found: &mut Found,
    singular: &dyn Fn() -> ReconstructError,
) -> Result<(), ReconstructError> {
    // an airspeed alone, filtered and late as pitots are, would be taken for vertical gusts
    if !(problem.log.has.alpha && problem.log.has.beta) {
        return Ok(());
    }
    let mut trial = found.clone();
    for channel in 3..6 {
        trial.levels.measured[channel] = trial.levels.white[channel];
        trial.levels.colour[channel] = 1.0;
    }
    trial.levels.gusts = likeliest_gusts(problem, &trial).ok_or_else(singular)?;
    if trial.levels.gusts <= CALM {
        return Ok(());
    }
    let deviations = gusts::deviations(problem, found, &trial, BOUND).ok_or_else(singular)?;
    for _ in 0..GUSTY {
        let solved = problem.held(&trial, BOUND).ok_or_else(singular)?;
        solved.apply(&mut trial, 1.0, &problem.options.name)?;
    }
    trial.deviations = deviations;
    *found = trial;
    Ok(())
}

/// The level of the gusts that the data find likeliest, m/s.
fn likeliest_gusts(problem: &Problem, found: &Found) -> Option<f64> {
    let mut trial = found.clone();
    let mut misfit = |gusts: f64| {
        trial.levels.gusts = gusts;
        problem.misfit(&trial, f64::INFINITY)
    };
    let (mut best, mut least) = (CALM, misfit(CALM)?);
    for coarse in COARSE {
        let now = misfit(coarse)?;
        if now > least {
            break;
        }
        (best, least) = (coarse, now);
    }
    if best == CALM {
        return Some(CALM);
    }
    for factor in FINE {
        for fine in [best / factor, best * factor] {
            let now = misfit(fine)?;
            if now < least {
                (best, least) = (fine, now);
                break;
            }
        }
    }
    Some(best)
}

/// Sets out in the wind that is stated, else in that which the measurements leave.
fn start(found: &mut Found, problem: &Problem) {
    let mut sum = (Vector3::zeros(), 0.0);
    for (path, track) in found.paths.iter().zip(&problem.log.tracks) {
        let (left, count) = path.wind_left(track);
        sum = (sum.0 + left, sum.1 + count);
    }
    let stated = problem.log.sensors.wind().map(Vector3::from);
    let wind = stated.or((sum.1 > 0.0).then(|| sum.0 / sum.1));
    if let Some(wind) = wind {
        found.values[WIND..WIND + 3].copy_from_slice(wind.as_slice());
        found.paths.iter_mut().for_each(|path| path.carry(wind));
    }
}
