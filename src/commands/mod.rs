//! Subcommands of `greylag`: their arguments, and the calls that carry them out.

#[macro_use]
mod console;

mod aircraft;
#[cfg(feature = "study")]
mod amend;
mod bar;
#[cfg(feature = "study")]
mod campaign;
mod choices;
pub mod controllers;
#[cfg(feature = "demo")]
mod collect;
mod compare;
#[cfg(feature = "study")]
mod completions;
#[cfg(feature = "demo")]
mod demo;
#[cfg(feature = "study")]
mod effect_files;
#[cfg(feature = "study")]
mod effects;
#[cfg(all(feature = "demo", feature = "study"))]
mod design;
#[cfg(feature = "study")]
mod diagnose;
pub mod distinct;
#[cfg(feature = "demo")]
mod evaluate;
mod exposure;
#[cfg(feature = "demo")]
mod faults;
mod files;
mod flown_with;
pub mod fly;
mod given;
#[cfg(feature = "study")]
mod held_out;
mod intake;
mod interruption;
#[cfg(feature = "learn")]
mod learn;
mod link;
mod log_once;
mod logs;
#[cfg(feature = "study")]
mod man;
mod mapping_file;
mod margin;
mod mistake;
#[cfg(feature = "demo")]
mod mystery;
mod no_vehicle;
#[cfg(feature = "study")]
mod per_flight;
mod predictions;
#[cfg(feature = "study")]
mod propose;
mod punctual;
#[cfg(feature = "demo")]
mod recording_report;
mod replay;
#[cfg(feature = "demo")]
mod report;
mod one_line;
mod outputs;
pub mod shipped;
mod status;
mod terminal;
#[cfg(feature = "demo")]
mod start;
#[cfg(feature = "demo")]
mod targets;
#[cfg(feature = "learn")]
mod train;
mod watchdog;
#[cfg(feature = "study")]
mod workbench;

#[cfg(feature = "study")]
use std::ffi::OsString;
use std::io::IsTerminal;
use std::process::ExitCode;
use std::sync::LazyLock;

use anyhow::Result;
#[cfg(feature = "study")]
use anyhow::bail;
use clap::{Parser, Subcommand};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::prelude::*;

use crate::sysid::progress::Cancelled;
#[cfg(feature = "study")]
use interruption::{Ended, Interruption};

/// The text that `-V` prints: the version of the package, the commit of the build, and the features.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let features = [
        ("demo", cfg!(feature = "demo")),
        ("study", cfg!(feature = "study")),
        ("learn", cfg!(feature = "learn")),
    ];
    let built: Vec<&str> =
        features.iter().filter(|(_, there)| *there).map(|(name, _)| *name).collect();
    let commit = option_env!("GREYLAG_COMMIT").unwrap_or("unknown");
    format!("{} (commit {commit}; features: {})", env!("CARGO_PKG_VERSION"), built.join(", "))
});

/// A MAVLink offboard autopilot companion for fixed-wing aircraft.
#[derive(Parser)]
#[command(name = "greylag", version = VERSION.as_str(), max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Print more messages; if given twice, print all.
    #[arg(short, long, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    verbose: u8,
    /// Show no progress and no warnings, only results and errors.
    #[arg(short, long, global = true)]
    quiet: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Describe an aircraft of your own, and check how it flies.
    Aircraft(aircraft::Arguments),
    /// Refit a model to flights and add missing effects to it, judged on flights that the fit has not seen.
    #[cfg(feature = "study")]
    Amend(amend::Arguments),
    /// Run a campaign, many runs with different models, controllers and random seeds, and tabulate the results.
    #[cfg(feature = "study")]
    Campaign(campaign::Arguments),
    /// Fly exploration flights in JSBSim, from which models are learned.
    #[cfg(feature = "demo")]
    Collect(collect::Arguments),
    /// Compare models with flight logs: prediction errors by horizon, channel and flight condition.
    Compare(compare::Arguments),
    /// Write completions for a shell to standard output.
    #[cfg(feature = "study")]
    Completions(completions::Arguments),
    /// Demonstrate the companion: it flies a sequence of attitudes, with simulator and client in the same program.
    #[cfg(feature = "demo")]
    Demo(demo::Arguments),
    /// Show the catalogue of physical effects.
    #[cfg(feature = "study")]
    Effects(effects::Arguments),
    /// Find the manoeuvre that best shows which of two effects a model lacks, and write it as a schedule.
    #[cfg(all(feature = "demo", feature = "study"))]
    Design(design::Arguments),
    /// Name the physical effect that a model lacks, from flight logs.
    #[cfg(feature = "study")]
    Diagnose(diagnose::Arguments),
    /// Fly controllers to the target attitudes of a file, in JSBSim inside this process, and score them.
    #[cfg(feature = "demo")]
    Evaluate(evaluate::Arguments),
    /// Fly many simulated flights with random faults of link, sensors and clocks, and check safety requirements.
    #[cfg(feature = "demo")]
    Faults(faults::Arguments),
    /// Fly a vehicle as its companion; ground stations and offboard programs connect to it.
    Fly(fly::Arguments),
    /// Learn a controller from a prior model in one command: flights, model, policy.
    #[cfg(feature = "learn")]
    Learn(learn::Arguments),
    /// Check the link to a flight controller.
    Link(link::Arguments),
    /// Show what a flight log holds, or write it as a CSV table.
    Logs(logs::Arguments),
    /// Fly a simulated aircraft with an effect that its model lacks, for a blind test of the diagnosis.
    #[cfg(feature = "demo")]
    Mystery(mystery::Arguments),
    /// Propose a formula for errors that no effect of the catalogue explains.
    #[cfg(feature = "study")]
    Propose(propose::Arguments),
    /// Write the manual pages of every subcommand into a folder.
    #[cfg(feature = "study")]
    Man(man::Arguments),
    /// Recompute the companion's commands of a recorded flight, and compare them with the recorded ones bit by bit.
    Replay(replay::Arguments),
    /// Draw a recorded flight as an HTML page: attitude, commands, timing, and prediction errors of the model.
    #[cfg(feature = "demo")]
    Report(report::Arguments),
    /// Write a file of random target attitudes for `evaluate`.
    #[cfg(feature = "demo")]
    Targets(targets::Arguments),
    /// Learn a model from flights, or a policy in a model.
    #[cfg(feature = "learn")]
    Train(train::Arguments),
    /// See where a model fails, accept effects and watch the error fall, in a browser.
    #[cfg(feature = "study")]
    Workbench(workbench::Arguments),
}

/// Parses the command line. An error ends the program.
fn parse() -> Arguments {
    let line = with_signs(<Arguments as clap::CommandFactory>::command());
    let found = line.get_matches();
    <Arguments as clap::FromArgMatches>::from_arg_matches(&found).unwrap_or_else(|e| e.exit())
}

/// Returns `command` with negative numbers allowed as values of its options and of those of its subcommands. Whether a
/// value is in range is checked later.
fn with_signs(command: clap::Command) -> clap::Command {
    let takes = |a: &clap::Arg| a.get_action().takes_values() && !a.is_positional();
    let command = command.mut_args(|a| if takes(&a) { a.allow_negative_numbers(true) } else { a });
    command.mut_subcommands(with_signs)
}

/// Runs the subcommand of the command line. An error is printed in one line.
pub fn main() -> ExitCode {
    let Arguments { command, verbose, quiet } = parse();
    bar::silence(quiet);
    let level = match (quiet, verbose) {
        (true, _) => LevelFilter::ERROR,
        (_, 0) => LevelFilter::WARN,
        (_, 1) => LevelFilter::INFO,
        (_, 2..) => LevelFilter::DEBUG,
    };
    // at the default level, JSBSim's warnings about an aircraft's XML file are hidden, because this program prints its own
    let port = if level == LevelFilter::WARN { LevelFilter::OFF } else { level };
    let asked = std::env::var("RUST_LOG").ok().and_then(|text| text.parse::<Targets>().ok());
    let filter =
        asked.unwrap_or_else(|| Targets::new().with_default(level).with_target("jsbsim", port));
    let lines = tracing_subscriber::fmt::layer()
        .without_time()
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(|| log_once::LogOnce);
    tracing_subscriber::registry().with(filter).with(lines).init();
    run(command).unwrap_or_else(|error| {
        if error.chain().any(|cause| cause.is::<Cancelled>()) {
            eprintln!("greylag: stopped by Ctrl-C; nothing was written");
            return ExitCode::from(status::INTERRUPTED);
        }
        eprintln!("greylag: {}", mistake::text(&error));
        ExitCode::FAILURE
    })
}

fn run(command: Command) -> Result<ExitCode> {
    match command {
        Command::Aircraft(arguments) => aircraft::run(&arguments),
        #[cfg(feature = "study")]
        Command::Amend(arguments) => amend::run(&arguments),
        #[cfg(feature = "study")]
        Command::Campaign(arguments) => campaign::run(&arguments),
        #[cfg(feature = "demo")]
        Command::Collect(arguments) => collect::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        #[cfg(feature = "study")]
        Command::Completions(arguments) => {
            completions::run(&arguments, &mut <Arguments as clap::CommandFactory>::command())
        }
        #[cfg(feature = "demo")]
        Command::Demo(arguments) => demo::run(&arguments),
        #[cfg(feature = "study")]
        Command::Effects(arguments) => effects::run(&arguments),
        #[cfg(all(feature = "demo", feature = "study"))]
        Command::Design(arguments) => design::run(&arguments),
        #[cfg(feature = "study")]
        Command::Diagnose(arguments) => diagnose::run(&arguments),
        #[cfg(feature = "demo")]
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        #[cfg(feature = "demo")]
        Command::Faults(arguments) => faults::run(&arguments),
        Command::Fly(arguments) => fly::run(&arguments),
        #[cfg(feature = "learn")]
        Command::Learn(arguments) => learn::run(&arguments),
        Command::Link(arguments) => link::run(&arguments),
        Command::Logs(arguments) => logs::run(&arguments),
        #[cfg(feature = "demo")]
        Command::Mystery(arguments) => mystery::run(&arguments),
        #[cfg(feature = "study")]
        Command::Propose(arguments) => propose::run(&arguments),
        #[cfg(feature = "study")]
        Command::Man(arguments) => {
            man::run(&arguments, <Arguments as clap::CommandFactory>::command())
        }
        Command::Replay(arguments) => replay::run(&arguments),
        #[cfg(feature = "demo")]
        Command::Report(arguments) => report::run(&arguments),
        #[cfg(feature = "demo")]
        Command::Targets(arguments) => targets::run(&arguments),
        #[cfg(feature = "learn")]
        Command::Train(arguments) => train::run(&arguments),
        #[cfg(feature = "study")]
        Command::Workbench(arguments) => workbench::run(&arguments),
    }
}

/// Parses the subcommand of a command line without the program's name.
#[cfg(feature = "study")]
fn command_of(line: &[OsString]) -> Result<Command> {
    let words = std::iter::once(OsString::from("greylag")).chain(line.iter().cloned());
    let found = with_signs(<Arguments as clap::CommandFactory>::command());
    let found = found.try_get_matches_from(words)?;
    Ok(<Arguments as clap::FromArgMatches>::from_arg_matches(&found)?.command)
}

/// Checks that the arguments `line` can be a stage of `greylag learn` or a cell (a run) of a campaign. These may collect
/// flights, evaluate controllers or train.
#[cfg(feature = "study")]
fn check_line(line: &[OsString]) -> Result<()> {
    match command_of(line)? {
        #[cfg(feature = "demo")]
        Command::Collect(_) | Command::Evaluate(_) => Ok(()),
        #[cfg(feature = "learn")]
        Command::Train(_) => Ok(()),
        _ => bail!("greylag {} cannot be a stage", line[0].display()),
    }
}

/// Runs a stage of `greylag learn` or a cell of a campaign until it ends or `stop` is set. An evaluation ignores `stop`.
#[cfg(feature = "study")]
#[cfg_attr(not(any(feature = "demo", feature = "learn")), expect(unused_variables))]
fn carry_out(line: &[OsString], stop: &Interruption) -> Result<Ended> {
    match command_of(line)? {
        #[cfg(feature = "demo")]
        Command::Collect(arguments) => collect::fly(&arguments, stop),
        #[cfg(feature = "demo")]
        Command::Evaluate(arguments) => evaluate::run(&arguments).map(|_| Ended::Done),
        #[cfg(feature = "learn")]
        Command::Train(arguments) => train::learn(&arguments, stop),
        _ => bail!("greylag {} cannot be a stage", line[0].display()),
    }
}

#[cfg(all(test, feature = "study"))]
mod tests {
    use super::*;

    #[test]
    fn a_stage_takes_negative_numbers_as_the_command_line_does() {
        let words =
            ["aircraft", "new", "own", "--mass-kg", "-2", "--span-m", "2", "--area-m2", "1"];
        let line = words.map(OsString::from);
        // the command itself checks the range of the mass
        assert!(matches!(command_of(&line), Ok(Command::Aircraft(_))));
    }
}
