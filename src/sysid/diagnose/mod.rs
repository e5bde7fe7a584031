//! Which physical effect a model lacks: candidates ranked, thresholds from null flights, or none of these.
//!
//! The method stands in `docs/explanation/diagnosis.md`. Flights must be
//! reconstructed with their deflections as recorded
//! ([`ActuatorClock::AsRecorded`](crate::flight_path::ActuatorClock)): what is clock and what is
//! physics is decided here.

mod answer;
mod error;
mod options;
mod proposal;
mod regression;
pub(crate) mod search;

pub use answer::curves::over_the_best;
pub use answer::result::{
    Advice, Candidate, ChannelLeft, Curve, Decoy, Diagnosis, FlightEstimate, FlightTrim,
    Measurement, Nulls, Parameter, Settings, Tuned, Verdict,
};
pub use answer::run::{diagnose, searched};
pub use error::DiagnoseError;
pub use options::{Detail, Options};
pub use proposal::{
    Alternative, Form, Free, FreeForms, Grades, HeldOut, Proposal, Rung, Shape, propose, signals,
    trend,
};
