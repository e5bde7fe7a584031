//! Errors of a diagnosis, which searches for effects (physical contributions to forces and moments) that a model lacks.

use crate::progress::Cancelled;
use crate::weak_form::prepared::ClockError;

/// Error of a diagnosis.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// No flight is given.
    #[error("cannot diagnose without a flight: give at least one log")]
    NoFlight,
    /// The sampling interval of a flight is not usable.
    #[error(transparent)]
    Flight(#[from] ClockError),
    /// The usable parts of the flights are too short.
    #[error(
        "cannot diagnose from {seconds:.0} s of flight: {least:.0} s in the air without gaps is the least; \
         fly longer, two or three flights of 50 s with the manoeuvres of `greylag design`"
    )]
    TooLittle {
        /// Usable duration of the flights, s.
        seconds: f64,
        /// Least duration needed, s.
        least: f64,
    },
    /// The flights contain no excitation.
    #[error(
        "cannot diagnose: the aircraft hardly leaves trim ({what}); fly doublets or a 3-2-1-1 on aileron, \
         elevator and throttle at two airspeeds"
    )]
    NoExcitation {
        /// The variables that hardly move, with the size of their motion, in words.
        what: String,
    },
    /// The residual (measured minus predicted value) cannot be computed in any channel.
    #[error(
        "cannot diagnose {model}: its residuals cannot be computed over these flights; check its figures \
         with `greylag compare` first"
    )]
    Unusable {
        /// Name of the model.
        model: String,
    },
    /// The user adds an unknown effect to the candidates (the effects to be tested), or excludes an unknown one.
    #[error(
        "cannot try or leave out effect {id:?}: it is unknown; `greylag effects list` names those there are"
    )]
    UnknownEffect {
        /// Identifier that is not known.
        id: String,
    },
    /// The progress listener cancelled the diagnosis.
    // not transparent: `Cancelled` must appear in the chain of error sources
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_effect_may_be_one_to_be_tried() {
        let said = DiagnoseError::UnknownEffect { id: "gyroscope".into() }.to_string();
        assert!(said.contains("cannot try or leave out effect \"gyroscope\""), "{said}");
    }
}
