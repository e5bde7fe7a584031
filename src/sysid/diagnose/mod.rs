//! Which physical effect a model lacks: candidates ranked, thresholds from null flights, or none of these.
//!
//! The method stands in `docs/explanation/diagnosis.md`. Flights must be
//! reconstructed with their deflections as recorded
//! ([`ActuatorClock::AsRecorded`](crate::sysid::reconstruct::ActuatorClock)): what is clock and what is
//! physics is decided here.

mod advice;
mod catalogue;
mod cells;
mod checks;
pub(super) mod clocks;
mod columns;
mod curves;
mod decoys;
mod detectable;
mod error;
mod excitation;
mod features;
mod gather;
mod local;
mod measurement;
mod noise;
mod nulls;
mod options;
mod projected;
mod rank;
mod ranking;
mod remainder;
mod result;
mod round;
mod run;
mod search;
mod sensors;
mod sentences;
mod settling;
mod shape;
mod shared;
mod shares;
mod whiten;

pub use error::DiagnoseError;
pub use options::{Detail, Options};
pub use result::{
    Advice, Candidate, ChannelLeft, Curve, Decoy, Diagnosis, FlightEstimate, Measurement, Nulls,
    Parameter, Settings, Tuned, Verdict,
};
pub use run::{diagnose, searched};
