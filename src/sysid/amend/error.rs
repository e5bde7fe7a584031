//! Errors of an amendment: of the fit of a model to flights, and of the addition of effects (physical contributions to forces and
//! moments) to the model.

use crate::progress::Cancelled;
use crate::weak_form::prepared::ClockError;
use greylag_model::JoinError;

/// Reason why an amendment failed.
#[derive(Debug, thiserror::Error)]
pub enum AmendError {
    /// An effect cannot be added to the model.
    #[error("cannot amend the model: {0}")]
    Effect(#[from] JoinError),
    /// The sampling interval of a flight is not usable.
    #[error("cannot amend the model: {0}")]
    Flight(#[from] ClockError),
    /// The usable parts of the flights are too short for a fit.
    #[error(
        "cannot fit {model}: {flown_s:.0} s in the air without gaps, where {needed_s:.0} s are the \
         least; fly two or three flights of a minute with doublets on every control"
    )]
    TooLittle {
        /// Name of the model.
        model: String,
        /// Usable duration of the flights, s.
        flown_s: f64,
        /// Smallest duration for a fit, s.
        needed_s: f64,
    },
    /// There are too few flights for leave-one-out cross-validation.
    #[error(
        "cannot leave out one flight after the other: {flights} are long enough to be predicted, and {needed} are the least; name more logs, \
         or cut one into parts with `greylag logs convert`"
    )]
    TooFewFlights {
        /// Number of flights that are long enough to be predicted. If the total number of flights is already too small, this is
        /// the total number.
        flights: usize,
        /// Smallest number of flights for the cross-validation.
        needed: usize,
    },
    /// Two flights have the same name. Constants of single flights are stored in the model file under the flight's name.
    #[error(
        "cannot estimate trims or axes for each flight: two of them are called {name}, and the model's file keeps these constants by \
         name; rename one of the logs"
    )]
    OneName {
        /// The name of both flights.
        name: String,
    },
    /// No coefficient may be changed by the fit.
    #[error(
        "cannot fit {model}: every coefficient is zero without a stated sd, so none may change; give \
         the model file an sd for those in doubt"
    )]
    NothingFree {
        /// Name of the model.
        model: String,
    },
    /// The flights give no information on any coefficient that the fit may change.
    #[error(
        "cannot fit {model}: these flights determine no coefficient better than the model file does, \
         because the aircraft hardly leaves trim; fly doublets or multisines on aileron, elevator and \
         throttle, and turns at several speeds"
    )]
    NoExcitation {
        /// Name of the model.
        model: String,
    },
    /// The iterations of the fit did not converge.
    #[error(
        "cannot fit {model}: the search had not settled after {iterations} iterations, the last \
         change being {change:.2} standard deviations of {parameter}; leave out flights in which the \
         aircraft spins or hits something, or fly more of what moves {parameter}"
    )]
    NotConverged {
        /// Name of the model.
        model: String,
        /// Number of iterations that were made.
        iterations: usize,
        /// Largest change of a parameter in the last iteration, in standard deviations of the parameter.
        change: f64,
        /// The parameter with the largest change.
        parameter: String,
    },
    /// Free runs (open-loop simulations) of the model diverge from the flights too early for a fit.
    #[error(
        "cannot fit {model}: its free runs leave the flights within {reach_s:.1} s, too early to \
         learn from; begin with a model closer to this aircraft, or check signs and units of the log"
    )]
    Diverges {
        /// Name of the model.
        model: String,
        /// Typical duration until free runs diverge, s.
        reach_s: f64,
    },
    /// The normal equations have no finite solution.
    #[error(
        "cannot fit {model}: the equations have no solution that is a number; check the log for \
         values that are not physical"
    )]
    Singular {
        /// Name of the model.
        model: String,
    },
    /// The amendment was cancelled.
    // the error is not declared `transparent`, because `Cancelled` must appear in the chain of error sources
    #[error("cancelled")]
    Cancelled(#[from] Cancelled),
}
