//! System identification from flight logs: flight-path reconstruction, comparison of models with flights, ranking of
//! missing effects, and amendment of a model.

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
