//! Why a diagnosis cannot be made.

use crate::progress::Cancelled;
use crate::weak_form::prepared::ClockError;

/// Why a diagnosis cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// No flight was given.
    #[error("cannot diagnose without a flight: give at least one log")]
    NoFlight,
    /// The flights cannot be brought to the model's clock.
    #[error(transparent)]
    Flight(#[from] ClockError),
    /// Too little was flown.
    #[error(
        "cannot diagnose from {seconds:.0} s of flight: {least:.0} s in the air without gaps is the least; \
         fly longer, two or three flights of 50 s with the manoeuvres of `greylag design`"
    )]
    TooLittle {
        /// What there is, s.
        seconds: f64,
        /// What is needed, s.
        least: f64,
    },
    /// Nothing was moved.
    #[error(
        "cannot diagnose: the aircraft hardly leaves trim ({what}); fly doublets or a 3-2-1-1 on aileron, \
         elevator and throttle at two airspeeds"
    )]
    NoExcitation {
        /// What hardly moves, with its figures.
        what: String,
    },
    /// No channel can be compared.
    #[error(
        "cannot diagnose {model}: its residuals cannot be worked out over these flights; check its figures \
         with `greylag compare` first"
    )]
    Unusable {
        /// The model.
        model: String,
    },
    /// An effect to be left out is not one of the catalogue.
    #[error(
        "cannot leave out effect {id:?}: it is unknown; `greylag effects list` names those there are"
    )]
    UnknownEffect {
        /// What was asked for.
        id: String,
    },
    /// Whoever listened ended it.
    // not transparent: this error itself must stand in the chain of causes
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}
