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
    /// Check a model's aircraft in flight: trim, modes, authority of the surfaces, margins of the
    /// LQI.
    Check(check::Arguments),
    /// Draw aircraft from a distribution, print how they fly and whether the shipped ones lie among them, and write their files.
    Draw(draw::Arguments),
    /// Write a model as an aircraft of another program.
    Export(export::Arguments),
    /// Fit a model of an aircraft of known mass, span and area to flights, write its page, and recommend what to fly next.
    #[cfg(feature = "study")]
    FromLog(from_log::Arguments),
    /// Make airframe and model from an aircraft of another program.
    Import(import::Arguments),
    /// Write airframe and model from mass, span, area and tail: textbook estimates with standard deviations.
    New(new::Arguments),
}

/// Runs `greylag aircraft …`.
///
/// # Errors
/// If a file cannot be read or written, or the aircraft cannot be flown at all.
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
