//! The program as a user runs it.
#![cfg(feature = "sitl")]

#[cfg(unix)]
mod campaign;
mod compare;
#[path = "../support/compare.rs"]
mod compare_support;
mod mystery;
mod policy;
mod program;
mod user_mistakes;
