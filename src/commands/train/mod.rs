//! `greylag train`: learns a model from flights, or a policy in a model.

mod analytic;
mod curves;
mod dynamics;
mod flights;
mod policy;
mod residual;

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
    /// Learn a dynamics model: a neural network for the part of the motion that the prior (physical) model does not explain, and
    /// with --trainable also coefficients of the prior.
    Dynamics(Box<dynamics::Arguments>),
    /// Fit a linear residual: a linear function of states and deflections that corrects the rates of a fitted model. It is
    /// written only if it lowers the error on flights that the fit has not seen.
    Residual(residual::Arguments),
    /// Train a policy in a model, or in JSBSim.
    Policy(Box<policy::Arguments>),
    /// Draw the learning curves of policies side by side.
    Curves(curves::Arguments),
}

/// Runs the chosen training until it ends or `stop` is set. The subcommands `residual` and `curves`
/// are an error, because they are no stage of a learning.
pub fn learn(arguments: &Arguments, stop: &Interruption) -> Result<Ended> {
    match &arguments.what {
        What::Dynamics(arguments) => dynamics::learn(arguments, stop),
        What::Policy(arguments) => policy::learn(arguments, stop),
        What::Residual(_) | What::Curves(_) => bail!("this is no stage of a learning"),
    }
}

/// Runs the chosen subcommand of `greylag train`.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.what {
        What::Dynamics(arguments) => dynamics::run(arguments),
        What::Residual(arguments) => residual::run(arguments),
        What::Policy(arguments) => policy::run(arguments),
        What::Curves(arguments) => curves::run(arguments),
    }
}
