//! Errors that a comparison of models with flights can return.

use crate::progress::Cancelled;
use crate::weak_form::prepared::ClockError;

/// Reason why models cannot be compared with flights.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum CompareError {
    /// No model is given.
    #[error("nothing to compare: name at least one model file (--model)")]
    NoModel,
    /// No flight is given.
    #[error("nothing to compare with: name at least one flight log (--log)")]
    NoLog,
    /// No log holds a usable flight. The value states the reason for each log.
    #[error(
        "no flight to compare with: {0}; give a log in which the aircraft flies for some seconds without gaps"
    )]
    NoFlight(String),
    /// The sampling interval of a flight is not usable.
    #[error(transparent)]
    Clock(#[from] ClockError),
    /// A horizon, s, is outside the range 0.01 to 600 s.
    #[error("horizon {0} s cannot be flown: give horizons from 0.01 to 600 s")]
    Horizon(f64),
    /// The progress listener cancelled the comparison.
    // not transparent: `Cancelled` must appear in the chain of error sources
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}
