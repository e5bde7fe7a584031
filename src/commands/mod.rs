//! Subcommands: arguments, then a few lines of work.

mod choices;
#[cfg(feature = "sitl")]
mod collect;
mod compare;
#[cfg(feature = "sitl")]
mod demo;
#[cfg(feature = "sitl")]
mod evaluate;
mod files;
pub mod fly;
mod intake;
mod logs;
#[cfg(feature = "sitl")]
mod targets;
#[cfg(feature = "learn")]
mod train;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tracing_subscriber::EnvFilter;

/// A MAVLink offboard autopilot companion for fixed-wing aircraft.
#[derive(Parser)]
#[command(name = "greylag", version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Explore in JSBSim, to have flights to learn from.
    #[cfg(feature = "sitl")]
    Collect(collect::Arguments),
    /// Compare models with flight logs: how far predictions stray, in which channel and regime.
    Compare(compare::Arguments),
    /// Fly a schedule of easy and hard attitudes: simulator, companion and client in one program.
    #[cfg(feature = "sitl")]
    Demo(demo::Arguments),
    /// Score controllers on the target file, flown in JSBSim in this process.
    #[cfg(feature = "sitl")]
    Evaluate(evaluate::Arguments),
    /// Fly a vehicle, serving ground stations and offboard programs.
    Fly(fly::Arguments),
    /// Say what a flight log holds, or write it as a CSV table.
    Logs(logs::Arguments),
    /// Write a target file.
    #[cfg(feature = "sitl")]
    Targets(targets::Arguments),
    /// Learn from flights.
    #[cfg(feature = "learn")]
    Train(train::Arguments),
}

/// Runs the subcommand of the command line; what goes wrong is said in one line.
pub fn main() -> ExitCode {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    let result = match Arguments::parse().command {
        #[cfg(feature = "sitl")]
        Command::Collect(arguments) => collect::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Demo(arguments) => demo::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Fly(arguments) => fly::run(&arguments),
        Command::Logs(arguments) => logs::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Targets(arguments) => targets::run(&arguments),
        #[cfg(feature = "learn")]
        Command::Train(arguments) => train::run(&arguments),
    };
    result.unwrap_or_else(|error| {
        eprintln!("greylag: {error:#}");
        ExitCode::FAILURE
    })
}
