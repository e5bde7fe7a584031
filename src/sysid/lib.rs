//! From flight logs to what is wrong with a model: reconstruct, compare, localise, rank, amend.

pub mod amend;
pub mod compare;
pub mod diagnose;
pub mod flight_path;
pub mod per_flight;
pub mod progress;
pub mod rudder;
pub mod signature;
pub mod separation;
pub mod weak_form;
