//! System identification from flight logs: reconstructs flight paths, compares models with flights, ranks the physical effects
//! (contributions to forces and moments) that a model lacks, and re-estimates models.

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
mod text;
pub mod weak_form;
