//! Diagnosis of a model: finds the physical effects (contributions to forces and moments) that it lacks. The candidates, which
//! are effects that it may lack, are ranked by their evidence, which must exceed a critical value. The critical value is
//! determined by bootstrap draws under the null hypothesis that no effect is missing.
//!
//! The method is described in `docs/explanation/diagnosis.md`. Flights must be reconstructed with their deflections as recorded
//! ([`ActuatorClock::AsRecorded`](crate::flight_path::ActuatorClock)), because the diagnosis itself separates delays of the
//! recorded deflections from physical effects.

mod answer;
mod error;
mod options;
mod proposal;
mod regression;
pub(crate) mod search;

pub use answer::curves::over_the_best;
pub use answer::probability::{Explained, Explanation};
pub use answer::result::{
    Advice, Candidate, ChannelLeft, Curve, Decoy, Diagnosis, FlightEstimate, FlightTrim,
    Measurement, Nulls, Parameter, Settings, Status, Tuned, Verdict,
};
pub use answer::run::{diagnose, searched};
pub use error::DiagnoseError;
pub use options::{Detail, Options};
pub use proposal::{
    Alternative, Form, Free, FreeForms, Grades, HeldOut, Proposal, Rung, Shape, propose, signals,
    trend,
};
