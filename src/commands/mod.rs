//! The subcommands of the program: arguments, then a few lines of work.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tracing_subscriber::EnvFilter;

/// Names the subcommands: each is a module with `Arguments` and `run(Arguments)`.
macro_rules! subcommands {
    ($($(#[$about:meta])* $name:ident => $module:ident,)*) => {
        $($(#[$about])* pub mod $module;)*

        #[derive(Subcommand)]
        enum Task { $($(#[$about])* $name($module::Arguments),)* }

        fn run(task: Task) -> anyhow::Result<ExitCode> {
            match task { $(Task::$name(arguments) => $module::run(arguments),)* }
        }
    };
}

subcommands! {
    /// Flies a vehicle and serves ground stations and offboard programs.
    Fly => fly,
}

/// A MAVLink offboard autopilot companion for fixed-wing aircraft.
#[derive(Parser)]
#[command(version)]
struct CommandLine {
    #[command(subcommand)]
    task: Task,
}

/// Reads the command line and does what it says; an error is one line on standard error.
pub fn main() -> ExitCode {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
    match run(CommandLine::parse().task) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("greylag: {error:#}");
            ExitCode::FAILURE
        }
    }
}
