//! `greylag train`: learns a model from flights, or a policy in a model.

mod analytic;
mod curves;
mod dynamics;
mod flights;
mod policy;

pub use flights::share;

use std::process::ExitCode;

use anyhow::{Result, bail};

use crate::commands::interruption::{Ended, Interruption};

/// Options of `greylag train`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand)]
enum What {
    /// Learn a dynamics model: a residual for what the prior lacks, and coefficients of the prior if requested.
    Dynamics(Box<dynamics::Arguments>),
    /// Train a policy in a model, or in JSBSim.
    Policy(Box<policy::Arguments>),
    /// Draw the learning curves of policies side by side.
    Curves(curves::Arguments),
}

/// Runs the chosen training until `stop` is set. Drawing curves is an error.
pub fn learn(arguments: &Arguments, stop: &Interruption) -> Result<Ended> {
    match &arguments.what {
        What::Dynamics(arguments) => dynamics::learn(arguments, stop),
        What::Policy(arguments) => policy::learn(arguments, stop),
        What::Curves(_) => bail!("drawing curves is no stage of a learning"),
    }
}

/// Runs the chosen training.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.what {
        What::Dynamics(arguments) => dynamics::run(arguments),
        What::Policy(arguments) => policy::run(arguments),
        What::Curves(arguments) => curves::run(arguments),
    }
}
