//! Why a comparison cannot be made.

use crate::progress::Cancelled;
use crate::weak_form::prepared::ClockError;

/// Why a comparison cannot be made.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum CompareError {
    /// No model was given.
    #[error("nothing to compare: name at least one model file (--model)")]
    NoModel,
    /// No flight was given.
    #[error("nothing to compare with: name at least one flight log (--log)")]
    NoLog,
    /// No log holds a flight that can be used.
    #[error(
        "no flight to compare with: {0}; give a log in which the aircraft flies for some seconds without gaps"
    )]
    NoFlight(String),
    /// The flight has no clock.
    #[error(transparent)]
    Clock(#[from] ClockError),
    /// A horizon cannot be flown.
    #[error("horizon {0} s cannot be flown: give horizons from 0.01 to 600 s")]
    Horizon(f64),
    /// Whoever listened ended it.
    // not transparent: this error itself must stand in the chain of causes
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}
