//! `greylag aircraft`: create, import, check and export the files of an aircraft.

mod check;
mod draw;
mod export;
#[cfg(feature = "study")]
mod from_log;
mod import;
mod import_derivatives;
#[cfg(feature = "demo")]
mod import_jsbsim;
mod new;

use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, Subcommand};

/// The arguments of `greylag aircraft`.
#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Compute trim, modes, control authority, and stability margins with the LQI (linear quadratic controller with integral
    /// action) of a model's aircraft.
    Check(check::Arguments),
    /// Draw aircraft from a distribution, print quantiles of their flight characteristics, state whether the shipped aircraft
    /// lie within these, and write the files of the drawn aircraft.
    Draw(draw::Arguments),
    /// Write a model as an aircraft of another program.
    Export(export::Arguments),
    /// Estimate a model from mass, span and wing area, fit it to flight logs, write a page on the fitted aircraft, and
    /// recommend what to fly next.
    #[cfg(feature = "study")]
    FromLog(from_log::Arguments),
    /// Make an airframe file and a model file from an aircraft of another program.
    Import(import::Arguments),
    /// Write an airframe file and a model file from mass, span, wing area and type of tail: textbook estimates with standard
    /// deviations.
    New(new::Arguments),
}

/// Runs `greylag aircraft …`.
///
/// # Errors
/// If a file cannot be read or written, or the aircraft cannot be trimmed or stabilised.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.command {
        Command::Check(arguments) => check::run(arguments),
        Command::Draw(arguments) => draw::run(arguments),
        Command::Export(arguments) => export::run(arguments),
        #[cfg(feature = "study")]
        Command::FromLog(arguments) => from_log::run(arguments),
        Command::Import(arguments) => import::run(arguments),
        Command::New(arguments) => new::run(arguments),
    }
}
