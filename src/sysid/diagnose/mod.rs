//! Which physical effect a model lacks.

mod result;

pub use result::{
    Advice, Candidate, ChannelLeft, Curve, Decoy, Diagnosis, FlightEstimate, Measurement, Nulls,
    Parameter, Settings, Tuned, Verdict,
};
