//! From flights to the missing effect: reconstruction, comparison, diagnosis, amendment.
#![cfg(feature = "sitl")]

mod amend;
mod amend_campaign;
mod amend_sound;
#[path = "../support/amend.rs"]
mod amend_support;
mod answer_box;
mod catalogue_files;
mod compare;
#[path = "../support/compare.rs"]
mod compare_support;
mod diagnose;
mod diagnosis_support;
mod formula_lags;
mod installation;
mod lacking_support;
mod lagging_support;
mod per_flight;
mod propose;
mod reconstruct;
#[path = "../support/reconstruct.rs"]
mod reconstruct_support;
mod sensors;
mod truth_elsewhere;
#[path = "../support/validate.rs"]
mod validate_support;
