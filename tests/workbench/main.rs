//! `greylag workbench` over real HTTP.
#![cfg(feature = "sitl")]

#[path = "../support/amend.rs"]
mod amend_support;
mod ahead;
mod failsafes;
mod own;
mod reading;
#[path = "../support/reconstruct.rs"]
mod reconstruct_support;
mod session;
mod workbench_support;
