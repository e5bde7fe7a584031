//! Sampling of a log's body rates: stated in the log, or inferred from the estimated clock skews.
//!
//! A simulator with explicit Euler steps logs the rate that it holds until the next sample. If this rate is interpreted as
//! a sample at an instant, it is half a sample period early. Every other sensor then seems delayed by half a period. A log
//! that does not state its sampling is first interpreted as samples at instants. The rates count as held if every
//! well-determined clock skew is half a period under samples at instants, and zero under held rates. Means over a sample
//! period need no separate case: they delay the gyros by half a period, and the estimated clock skews include this delay.

use crate::flight_path::ReconstructError;
use crate::flight_path::equations::{Found, Problem};
use crate::flight_path::intake::Log;
use crate::flight_path::nuisance::{
    SKEW_AIRSPEED, SKEW_ATTITUDE, SKEW_FORCE, SKEW_VANES, SKEW_VELOCITY, concerned,
};
use crate::flight_path::smoother::smooth;
use greylag_logs::Sampling;

/// Smallest number of clock skews that must agree.
const FEWEST: usize = 2;
/// A clock skew counts as well determined if its standard deviation is below this fraction of the sample period.
const KNOWN: f64 = 0.1;
/// Tolerance for the clock skews of a simulator, as a fraction of the sample period. It covers the differences due to
/// interpolation errors.
const AGREE: f64 = 0.03;
/// Additional tolerance, in standard deviations of the clock skew.
const DEVIATIONS: f64 = 3.0;

/// The sampling of a log, the path estimated with this sampling, and a note on the choice.
pub struct Chosen {
    /// Meaning of a rate sample.
    pub sampling: Sampling,
    /// Estimated path and constants.
    pub found: Found,
    /// Evidence for the choice, if the log does not state the sampling.
    pub note: Option<String>,
}

/// Smooths the log of `problem` under the sampling `declared`, or else under the sampling that the clock skews support.
///
/// # Errors
/// [`ReconstructError::NoPath`] if the search has no finite result.
pub fn choose(problem: &Problem, declared: Option<Sampling>) -> Result<Chosen, ReconstructError> {
    let under = |sampling| smooth(&Problem { sampling, ..*problem });
    if let Some(sampling) = declared {
        return Ok(Chosen { sampling, found: under(sampling)?, note: None });
    }
    let instants = under(Sampling::Instants)?;
    let step = problem.log.step;
    if agree(problem.log, &instants, 0.5 * step)
        && let Ok(held) = under(Sampling::Held)
        && agree(problem.log, &held, 0.0)
    {
        let note = format!(
            "Body rates hold for a sample period, as a stepping simulator's do: all clocks then agree; read \
             as samples at instants, every sensor would be {:.1} ms late.",
            500.0 * step
        );
        return Ok(Chosen { sampling: Sampling::Held, found: held, note: Some(note) });
    }
    Ok(Chosen { sampling: Sampling::Instants, found: instants, note: None })
}

/// Whether all well-determined clock skews of the log equal `late` (s) within tolerance, and there are enough of them.
fn agree(log: &Log, found: &Found, late: f64) -> bool {
    let clocks = [SKEW_ATTITUDE, SKEW_AIRSPEED, SKEW_VANES, SKEW_VELOCITY, SKEW_FORCE];
    let known: Vec<usize> = clocks
        .into_iter()
        .filter(|place| concerned(*place, &log.has))
        .filter(|place| found.deviations[*place] < KNOWN * log.step)
        .collect();
    let close = |place: &usize| {
        let bound = DEVIATIONS * found.deviations[*place] + AGREE * log.step;
        (found.values[*place] - late).abs() < bound
    };
    known.len() >= FEWEST && known.iter().all(close)
}
