//! Aircraft other than the X8, from their files to flights and a diagnosis.
#![cfg(feature = "sitl")]

mod aerosonde;
#[path = "../support/compare.rs"]
mod compare_support;
mod elevons;
mod own_aircraft;
mod real_flight;
mod study_support;
mod trainer;
