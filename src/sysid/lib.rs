//! From flight logs to what is wrong with a model: reconstruct, compare, localise, rank, amend.

#[cfg(feature = "study")]
pub mod amend;
pub mod compare;
#[cfg(feature = "study")]
pub mod diagnose;
pub mod flight_path;
pub mod per_flight;
pub mod progress;
pub mod rudder;
#[cfg(feature = "study")]
pub mod signature;
#[cfg(feature = "study")]
pub mod separation;
pub mod weak_form;
