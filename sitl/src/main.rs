//! The program `greylag-sitl`: simulates an aircraft and its flight controller for a companion.

mod one_line;

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use clap::Parser;
use greylag_sitl::arguments::Cli;
use greylag_sitl::shim::{self, Launch, Pace, ShimOptions};
use one_line::one_line;

fn main() -> ExitCode {
    match fly(&Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("greylag-sitl: {}", one_line(&error));
            ExitCode::FAILURE
        }
    }
}

fn fly(cli: &Cli) -> anyhow::Result<()> {
    let options = cli.options()?;
    let stop = Arc::new(AtomicBool::new(false));
    let handler = Arc::clone(&stop);
    ctrlc::set_handler(move || handler.store(true, Ordering::Relaxed))
        .context("cannot listen for Ctrl-C")?;
    print(format_args!("greylag-sitl: {}", intent(&options)));
    if !options.unplayed.is_empty() {
        let (count, names) = (options.unplayed.len(), options.unplayed.join(", "));
        print(format_args!("{count} parameters of the file are not simulated: {names}"));
    }
    let mut tell =
        |notice: shim::Notice| print(format_args!("{:9.2} s  {}", notice.time_s, notice.event));
    let summary = shim::run(&options, &stop, &mut tell)?;
    print(format_args!("\n{summary}"));
    Ok(())
}

/// Prints a line and ignores a write error: a closed pipe must not end the flight.
fn print(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Description of the run in one line.
fn intent(options: &ShimOptions) -> String {
    let pace = match options.pace {
        Pace::RealTime => "in real time, 100 frames a second",
        Pace::Lockstep => "in lockstep, as fast as the companion answers",
    };
    let launch = match options.launch {
        Launch::WhenArmed => "held at the start until the companion arms",
        Launch::Immediate => "flying at once",
    };
    let stacks = [("PX4", options.px4.is_some()), ("ArduPilot", options.ardupilot.is_some())];
    if let Some((stack, _)) = stacks.into_iter().find(|(_, flies)| *flies) {
        return format!("{} as the simulator of {stack}; Ctrl-C ends it", options.plant.aircraft);
    }
    match options.personality {
        Some(personality) => format!(
            "{} flown by {personality} in real time, armed and in the air; Ctrl-C ends it",
            options.plant.aircraft
        ),
        None => format!("{} {pace}, {launch}; Ctrl-C ends it", options.plant.aircraft),
    }
}
