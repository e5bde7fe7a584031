//! Training of models and policies.
#![cfg(feature = "learn")]

mod analytic;
mod beside_burn;
#[cfg(feature = "sitl")]
mod command;
mod gradient;
mod imagined;
#[path = "learn_support/in_burn.rs"]
mod in_burn;
mod learn_support;
mod td3;
#[cfg(feature = "sitl")]
mod train_command;
mod training;
mod valuation;
