//! Sampling of a log's body rates: a sample is the value at an instant, or a value that holds until the next sample. The log
//! states which, or it is inferred from the clock skews, the estimated delays of the other sensors relative to the rates.
//!
//! A simulator with explicit Euler steps logs the rate that it holds until the next sample. If such a rate is taken for the
//! value at an instant, it is half a sample period early, and every other sensor seems delayed by half a period. A log
//! that does not state its sampling is therefore reconstructed with values at instants first. If all well-determined
//! clock skews are half a period, it is reconstructed again with held rates. If the skews are zero in this second
//! reconstruction, the rates count as held. Rates that are means over a sample period need no separate case: they are
//! delayed by half a period, which the clock skews include.

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
/// Tolerance for clock skews, as a fraction of the sample period. It covers interpolation errors.
const AGREE: f64 = 0.03;
/// Additional tolerance, in standard deviations of the estimated clock skew.
const DEVIATIONS: f64 = 3.0;

/// The sampling of a log, and the path estimated with this sampling.
pub struct Chosen {
    /// Meaning of a rate sample.
    pub sampling: Sampling,
    /// Estimated path and constants (sensor errors, wind).
    pub found: Found,
    /// Note with the reason, if the rates were found to be held.
    pub note: Option<String>,
}

/// Estimates the path for the sampling `declared`. If it is `None`, the sampling is inferred from the clock skews.
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

/// Whether there are enough well-determined clock skews, and all of them equal `late` (s) within the tolerance.
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
