//! `greylag replay`: the pilot on a recorded flight, its commands compared bit by bit.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Args;

use crate::commands::choices;
use crate::commands::fly::{self, CommandName, ProfileName};
use crate::control::Kind;
use crate::control::cem::Change;
use crate::flight::replay::{Outcome, replay};
use crate::link::vehicle::{Profile, Real, Sitl, Vehicle};
use crate::manoeuvres::Schedule;
use crate::model::GreyBox;
use crate::physics::airframe::ActuatorFigures;

/// The arguments of `greylag replay`: those that the flight was flown with.
#[derive(Args)]
pub struct Arguments {
    /// Folder that `greylag fly` has recorded.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Controller that flew.
    #[arg(long, value_name = "NAME", default_value = fly::CONTROLLER, value_parser = choices::controller())]
    controller: Kind,
    /// Model that it was designed from.
    #[arg(long, value_name = "FILE", default_value = fly::MODEL)]
    model: PathBuf,
    /// Folder of the trained policy, for controllers that need one.
    #[arg(long, value_name = "DIR", default_value = fly::POLICY)]
    policy: PathBuf,
    /// Settings of the planner that were not of their usual size.
    #[arg(long = "planner", value_name = "KEY=VALUE", num_args = 1..)]
    changes: Vec<Change>,
    /// Airframe file in place of the one that the model names.
    #[arg(long, value_name = "FILE")]
    airframe: Option<PathBuf>,
    /// Schedule that was flown.
    #[arg(long, value_name = "FILE")]
    schedule: Option<PathBuf>,
    /// What was at the other end of the vehicle's link.
    #[arg(long, value_name = "NAME", default_value = "sitl", value_enum)]
    profile: ProfileName,
    /// What a real flight controller was commanded.
    #[arg(long, value_name = "WHAT", default_value = "surfaces", value_enum)]
    command: CommandName,
}

/// Replays; the exit status tells whether every command came out as it was recorded.
///
/// # Errors
/// If a file cannot be used.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let mut model = fly::model(&arguments.model, arguments.airframe.as_deref())?;
    if arguments.profile.stack().is_some() {
        model = model.leaving_rudder();
    }
    let Arguments { controller, policy, changes, .. } = arguments;
    let mut companion = fly::companion_with_planner(*controller, &model, policy, changes)?;
    if let Some(path) = &arguments.schedule {
        companion.pilot.follow(Schedule::load(path)?);
    }
    let outcome = replay(&arguments.folder, companion, vehicle(arguments, &model))?;
    print(&outcome);
    let exact = outcome.different == 0 && outcome.without_state <= u64::from(outcome.cut_short);
    Ok(if exact && outcome.ticks > 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn vehicle(arguments: &Arguments, model: &GreyBox) -> Vehicle {
    let figures = model.airframe.actuators;
    match arguments.profile.stack() {
        None => Vehicle::Sitl(Sitl::new(1, figures.travels())),
        Some(stack) => {
            let actuators = ActuatorFigures { rudder: None, ..figures };
            let authority = arguments.command.authority();
            Vehicle::Real(Box::new(Real::new(Profile { stack, authority, actuators })))
        }
    }
}

fn print(outcome: &Outcome) {
    println!("{} ticks replayed; {} commands differ", outcome.ticks, outcome.different);
    if outcome.cut_short {
        println!("the recording ends in the middle of something: replayed up to there");
    }
    if outcome.without_state > 0 {
        println!("{} ticks have no state in flight.tlog", outcome.without_state);
    }
    for d in &outcome.differences {
        let words = |c: &crate::physics::Command| {
            format!("{:+.6} {:+.6} {:.6}", c.aileron, c.elevator, c.throttle)
        };
        println!(
            "  {:10.3} s: recorded {}, replayed {}",
            d.time.as_secs_f64(),
            words(&d.recorded),
            words(&d.replayed)
        );
    }
    if outcome.different > 0 && outcome.plans_different > 0 {
        println!(
            "{} plans differ: were --controller, --model, --planner, --schedule those of the flight, and was it \
             this version of the program?",
            outcome.plans_different
        );
    }
}
