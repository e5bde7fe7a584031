//! Subcommands: arguments, then a few lines of work.

mod aircraft;
mod amend;
mod choices;
#[cfg(feature = "sitl")]
mod collect;
mod compare;
#[cfg(feature = "sitl")]
mod demo;
mod effect_files;
mod effects;
#[cfg(feature = "sitl")]
mod design;
mod diagnose;
#[cfg(feature = "sitl")]
mod evaluate;
#[cfg(feature = "sitl")]
mod faults;
mod files;
pub mod fly;
mod intake;
mod link;
mod log_once;
mod logs;
#[cfg(feature = "sitl")]
mod mystery;
mod propose;
mod replay;
mod said_once;
#[cfg(feature = "sitl")]
mod start;
#[cfg(feature = "sitl")]
mod targets;
#[cfg(feature = "learn")]
mod train;

use std::io::IsTerminal;
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
    /// Describe an aircraft of your own, and check how it flies.
    Aircraft(aircraft::Arguments),
    /// Refit a model to flights and add missing effects to it, judged on flights it has not seen.
    Amend(amend::Arguments),
    /// Explore in JSBSim, to have flights to learn from.
    #[cfg(feature = "sitl")]
    Collect(collect::Arguments),
    /// Compare models with flight logs: how far predictions stray, in which channel and regime.
    Compare(compare::Arguments),
    /// Fly a schedule of easy and hard attitudes: simulator, companion and client in one program.
    #[cfg(feature = "sitl")]
    Demo(demo::Arguments),
    /// Say what the catalogue of physical effects knows.
    Effects(effects::Arguments),
    /// Find the manoeuvre that tells two missing effects apart, as a schedule to fly.
    #[cfg(feature = "sitl")]
    Design(design::Arguments),
    /// Name the physical effect that a model lacks, from flight logs.
    Diagnose(diagnose::Arguments),
    /// Score controllers on the target file, flown in JSBSim in this process.
    #[cfg(feature = "sitl")]
    Evaluate(evaluate::Arguments),
    /// Fly many seeded flights under faults of link, sensors, clocks; judge them.
    #[cfg(feature = "sitl")]
    Faults(faults::Arguments),
    /// Fly a vehicle, serving ground stations and offboard programs.
    Fly(fly::Arguments),
    /// Check the link to a flight controller.
    Link(link::Arguments),
    /// Say what a flight log holds, or write it as a CSV table.
    Logs(logs::Arguments),
    /// Fly an aircraft that has an effect which its model lacks: data to find it in.
    #[cfg(feature = "sitl")]
    Mystery(mystery::Arguments),
    /// Propose a formula for what no effect of the catalogue explains.
    Propose(propose::Arguments),
    /// Replay a recorded flight, and compare the pilot's commands bit by bit.
    Replay(replay::Arguments),
    /// Write a target file.
    #[cfg(feature = "sitl")]
    Targets(targets::Arguments),
    /// Learn a model from flights, or a policy in a model.
    #[cfg(feature = "learn")]
    Train(train::Arguments),
}

/// Runs the subcommand of the command line; what goes wrong is said in one line.
pub fn main() -> ExitCode {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .without_time()
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(|| log_once::LogOnce)
        .init();
    let result = match Arguments::parse().command {
        Command::Aircraft(arguments) => aircraft::run(&arguments),
        Command::Amend(arguments) => amend::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Collect(arguments) => collect::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Effects(arguments) => effects::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Design(arguments) => design::run(&arguments),
        Command::Diagnose(arguments) => diagnose::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Faults(arguments) => faults::run(&arguments),
        Command::Fly(arguments) => fly::run(&arguments),
        Command::Link(arguments) => link::run(&arguments),
        Command::Logs(arguments) => logs::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Mystery(arguments) => mystery::run(&arguments),
        Command::Propose(arguments) => propose::run(&arguments),
        Command::Replay(arguments) => replay::run(&arguments),
        #[cfg(feature = "sitl")]
        Command::Targets(arguments) => targets::run(&arguments),
        #[cfg(feature = "learn")]
        Command::Train(arguments) => train::run(&arguments),
    };
    result.unwrap_or_else(|error| {
        eprintln!("greylag: {}", said_once::said_once(&error));
        ExitCode::FAILURE
    })
}
