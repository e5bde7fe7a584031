//! Logs of all formats, as they are and as they should not be.

mod command;
#[cfg(feature = "sitl")]
#[path = "../support/compare.rs"]
mod compare_support;
#[cfg(feature = "sitl")]
mod comparison;
mod formats;
mod found_public;
mod lean;
#[path = "../support/logs.rs"]
mod logs_support;
mod odd_files;
mod odd_setups;
#[cfg(feature = "sitl")]
#[path = "../support/reconstruct.rs"]
mod reconstruct_support;
#[cfg(feature = "sitl")]
mod screening;
