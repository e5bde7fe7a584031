//! Refits a model to flights by output error and adds effects (physical contributions to forces and moments) to it.
//!
//! The method is described in `docs/explanation/diagnosis.md`. An equation-error fit provides starting values of the
//! coefficients. An output-error fit by multiple shooting (simulations of short segments) refines them. Held-out flights, which
//! were not fitted, validate the result.

mod amendment;
mod answer;
mod bounds;
mod conventions;
mod derivatives;
pub mod document;
mod equation_error;
mod error;
mod flight;
mod interval;
mod judge;
mod learned;
pub mod linear_residual;
pub mod leave_one_out;
mod normal;
pub mod output_error;
mod parameters;
mod quick;
mod result;
#[cfg(test)]
pub(crate) mod sample;
mod shooting;
mod story;

pub use amendment::{Added, Amended, Options, Prior, Refused, amend, split};
pub use answer::{Diagnosed, Origin, diagnosed};
pub use bounds::lifted;
pub use conventions::{Convention, Tried};
pub use error::AmendError;
pub use flight::Flight;
pub use judge::contradictions;
pub use output_error::{Fit, FitOptions};
pub use parameters::widened;
pub use quick::{Estimate, estimate, tune};
pub use result::{
    AddedEffect, Amendment, FittedFlight, FlightEstimate, OwnConstant, Parameter, Settings,
};
