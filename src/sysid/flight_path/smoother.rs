//! The smoother of the flight-path reconstruction: fits path and constants to all sensors by Gauss–Newton iterations. The path
//! is attitude, velocity and gust over time. The constants are sensor errors and the steady wind.
//!
//! First, motion and constants are fitted. Gusts then count as noise of the air-data sensors. If the data make gusts more
//! likely than white noise, gusts along the path are estimated afterwards, while the constants keep their values. The standard
//! deviations of the constants are raised by the effect of these gusts. A joint estimate of path, gusts and constants would
//! give an airspeed scale far above 1, because a large scale makes every gust smaller.

use nalgebra::Vector3;

use crate::flight_path::ReconstructError;
use crate::flight_path::calibration;
use crate::flight_path::equations::{Found, HELD, Problem, Solved, no_path};
use crate::flight_path::gusts;
use crate::flight_path::intake::Track;
use crate::flight_path::kinematics::MOTION;
use crate::flight_path::levels::{CALM, GUST_TIME, Levels};
use crate::flight_path::nuisance::{self, WIND};
use crate::flight_path::path::Path;

/// Standard deviations of the gusts that are tried first, m/s. `FINE` holds the factors of the refinement around the best
/// of them.
const COARSE: [f64; 4] = [0.02, 0.1, 0.5, 2.0];
const FINE: [f64; 3] = [2.0, 1.4, 1.2];
/// Gusts of more than this standard deviation (m/s) bias the estimates of sensor errors. The level belongs to the correlation time
/// [`GUST_TIME`]: gusts of 0.14 m/s over 1.5 s change as fast. A vane gain of 9 % that is not freed looks like 0.1 m/s.
const STRONG: f64 = 0.5;
/// Residuals beyond this number of standard deviations are down-weighted.
const BOUND: f64 = 4.0;
/// Correlation times of gusts that are tried, s.
const TIMES: [f64; 6] = [GUST_TIME, 10.0, 5.0, 2.5, 1.2, 0.6];
/// Number of iterations with gusts.
const GUSTY: usize = 4;
/// Number of iterations before noise levels are estimated from residuals. `LAST` is the largest total number of iterations.
const FIRST: usize = 2;
const LAST: usize = 25;
/// Convergence tolerance: largest change of a constant, in its standard deviations. `LEVEL_TOLERANCE` is the largest change
/// of the natural logarithm of a noise level.
const STEP_TOLERANCE: f64 = 0.05;
const LEVEL_TOLERANCE: f64 = 0.02;
/// Smallest fraction of a step that the line search tries.
const LEAST_PART: f64 = 1.0 / 64.0;

/// Smooths all stretches of the log together.
///
/// # Errors
/// [`ReconstructError::NoPath`] if the search has no finite result.
pub fn smooth(problem: &Problem) -> Result<Found, ReconstructError> {
    let singular = || no_path(&problem.options.name, "the equations became singular");
    let mut found = first(problem)?;
    let mut freed = *problem;
    free(&mut freed, &mut found, &[])?;
    match rough(&freed, &mut found, &singular)? {
        Some(levels) if levels.gusts > STRONG => {
            // the first fit is made again: a copy of it would take memory in all flights, also in those without strong gusts
            drop(found);
            in_gusts(problem)
        }
        Some(levels) => {
            gusty(&freed, &mut found, levels, &singular)?;
            Ok(found)
        }
        None => Ok(found),
    }
}

/// The fit of motion and constants without gusts and without rare errors of the sensors.
fn first(problem: &Problem) -> Result<Found, ReconstructError> {
    let Problem { log, means, widths, .. } = *problem;
    let mut found = Found {
        paths: log.tracks.iter().map(Path::guess).collect(),
        values: means,
        deviations: widths,
        widths,
        levels: Levels::first(log),
        suspects: Vec::new(),
    };
    start(&mut found, problem);
    calm(problem, &mut found, 0)?;
    Ok(found)
}

/// Fits again from the first fit, which is without rare errors of the sensors, if gusts are strong. Errors of the air-data sensors
/// keep their prior means and standard deviations, because gusts bias their estimates. Any other error must be beyond doubt with
/// the standard deviation that gusts give it, too.
fn in_gusts(problem: &Problem) -> Result<Found, ReconstructError> {
    let singular = || no_path(&problem.options.name, "the equations became singular");
    let mut held = calibration::OF_AIR.to_vec();
    let long = problem.log.tracks.iter().map(Track::len).sum::<usize>() > HELD;
    let mut before: Option<Found> = None;
    loop {
        let (mut freed, mut found) = (*problem, before.take().map_or_else(|| first(problem), Ok)?);
        // the first fit of a long flight is made again where a second round needs it: a copy would take much memory
        before = (!long).then(|| found.clone());
        for place in calibration::OF_AIR {
            freed.widths[place] = nuisance::exact(place, freed.widths[place]);
        }
        calm(&freed, &mut found, FIRST)?;
        free(&mut freed, &mut found, &held)?;
        if let Some(levels) = rough(&freed, &mut found, &singular)? {
            let levels = correlated(&freed, &mut found, levels).ok_or_else(singular)?;
            gusty(&freed, &mut found, levels, &singular)?;
        }
        for place in calibration::OF_AIR {
            found.widths[place] = problem.widths[place];
            found.deviations[place] = problem.widths[place];
        }
        let doubtful = calibration::doubtful(problem, &found);
        if doubtful.is_empty() {
            found.suspects.clear();
            return Ok(found);
        }
        held.extend(doubtful);
    }
}

/// Gives rare errors of the sensors a wide prior where the data ask for it, and fits again after each one. The constants `held`
/// keep their priors.
fn free(problem: &mut Problem, found: &mut Found, held: &[usize]) -> Result<(), ReconstructError> {
    loop {
        found.suspects = calibration::suspects(problem, found, BOUND, held);
        let Some((place, width)) = calibration::next(problem, &found.suspects) else {
            return Ok(());
        };
        problem.widths[place] = width;
        found.widths = problem.widths;
        calm(problem, found, FIRST)?;
    }
}

/// `levels` of strong gusts with their most likely correlation time and level, beside white noise of the vanes. `found` is not changed.
///
/// The gust's change from one sample to the next is well known, its correlation time is not. The default [`GUST_TIME`] overstates the
/// error of mean wind and biases where gusts are quick.
fn correlated(problem: &Problem, found: &mut Found, levels: Levels) -> Option<Levels> {
    with_levels(found, levels.beside_gusts(problem.log), |found| {
        let step = problem.log.step;
        found.levels.gusts = likeliest_gusts(problem, found)?;
        let (change, mut least) = (found.levels.gust_step(step), f64::INFINITY);
        let mut best = found.levels;
        for gust_time in TIMES {
            let mut levels = best;
            (levels.gust_time, levels.gusts) = (gust_time, 1.0);
            levels.gusts = change / levels.gust_step(step);
            found.levels = levels;
            let now = problem.misfit(found, f64::INFINITY)?;
            if now > least {
                break;
            }
            (best, least) = (levels, now);
        }
        Some(best)
    })
}

/// The result of `of` for `found` with `levels`. Afterwards `found` has its own levels again: a copy with other levels would have the
/// whole path.
fn with_levels<T>(found: &mut Found, levels: Levels, of: impl FnOnce(&mut Found) -> T) -> T {
    let own = std::mem::replace(&mut found.levels, levels);
    let result = of(found);
    found.levels = own;
    result
}

/// Fits motion and constants without gusts. The iterations are numbered from `from`.
fn calm(problem: &Problem, found: &mut Found, from: usize) -> Result<(), ReconstructError> {
    let Problem { log, options, .. } = *problem;
    let singular = || no_path(&options.name, "the equations became singular");
    for iteration in from..LAST {
        let bound = if iteration < FIRST { f64::INFINITY } else { BOUND };
        let solved = problem.calm(found, bound).ok_or_else(singular)?;
        let moved = search(problem, found, &solved, bound)?;
        if iteration < FIRST {
            continue;
        }
        let change = found.levels.renew(&solved.residuals, log.step);
        let change = change.max(found.levels.loosen(&problem.step_residuals(found)));
        if iteration > from.max(FIRST) && moved < STEP_TOLERANCE && change < LEVEL_TOLERANCE {
            break;
        }
    }
    Ok(())
}

/// Line search: applies the Gauss–Newton step `solved` to `found`, or the largest of its fractions ½, ¼ … that does not raise
/// the merit function. If there is none, `found` keeps its path and constants. Returns the largest change of a constant in its
/// standard deviations.
///
/// In a nearly straight flight, wind, airspeed scale and path are confounded. Without the line search, a wrong wind of 5 m/s
/// was estimated from the first minute of a real ArduPlane flight.
fn search(
    problem: &Problem,
    found: &mut Found,
    solved: &Solved<MOTION>,
    bound: f64,
) -> Result<f64, ReconstructError> {
    let before = problem.merit(found, bound, Some(solved.residuals.as_slice()));
    let mut part = 1.0;
    while part >= LEAST_PART {
        let mut trial = found.clone();
        let moved = solved.apply(&mut trial, part, &problem.options.name)?;
        if problem.merit(&trial, bound, None) <= before {
            *found = trial;
            return Ok(moved);
        }
        part *= 0.5;
    }
    found.deviations = solved.deviations;
    Ok(0.0)
}

/// The noise levels of `found`, which is not changed, with the most likely level of the gusts. `None` if the data do not make gusts
/// more likely than white noise of the air-data sensors.
fn rough(
    problem: &Problem,
    found: &mut Found,
    singular: &dyn Fn() -> ReconstructError,
) -> Result<Option<Levels>, ReconstructError> {
    // if a vane is missing, a filter or a delay of the airspeed sensor would be mistaken for vertical gusts
    if !(problem.log.has.alpha && problem.log.has.beta) {
        return Ok(None);
    }
    let mut levels = found.levels;
    for channel in 3..6 {
        levels.measured[channel] = levels.white[channel];
        levels.colour[channel] = 1.0;
    }
    let gusts = with_levels(found, levels, |found| likeliest_gusts(problem, found));
    levels.gusts = gusts.ok_or_else(singular)?;
    Ok(Some(levels).filter(|levels| levels.gusts > CALM))
}

/// Estimates gusts along the path of `found`, a fit without gusts, with the noise levels `levels`.
fn gusty(
    problem: &Problem,
    found: &mut Found,
    levels: Levels,
    singular: &dyn Fn() -> ReconstructError,
) -> Result<(), ReconstructError> {
    let deviations = gusts::deviations(problem, found, &levels, BOUND).ok_or_else(singular)?;
    found.levels = levels;
    for _ in 0..GUSTY {
        let solved = problem.held(found, BOUND).ok_or_else(singular)?;
        solved.apply(found, 1.0, &problem.options.name)?;
    }
    found.deviations = deviations;
    Ok(())
}

/// The most likely standard deviation of the gusts, m/s. `None` if the equations are singular. The level of the gusts in `found` is
/// changed by the search.
fn likeliest_gusts(problem: &Problem, found: &mut Found) -> Option<f64> {
    let mut misfit = |gusts: f64| {
        found.levels.gusts = gusts;
        problem.misfit(found, f64::INFINITY)
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

/// Initialises the wind with the wind that the user states in the description of the sensors, or else with the mean
/// difference between measured and guessed velocities.
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

#[cfg(test)]
mod tests;
