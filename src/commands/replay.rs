//! `greylag replay`: replays a recorded flight and compares the pilot's commands bit by bit.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use serde::Serialize;

use crate::commands::choices;
use crate::commands::controllers;
use crate::commands::files::{JsonArgument, Overwrite};
use crate::commands::flown_with::FlownWith;
use crate::commands::fly::{self, CommandName, ProfileName};
use crate::control::ControllerKind;
use crate::control::cem::Change;
use crate::flight::replay::{Difference, Outcome, replay};
use crate::flight::runtime::Companion;
use crate::link::vehicle::{Profile, Real, Sitl, Vehicle};
use crate::manoeuvres::Schedule;
use crate::model::GreyBox;
use crate::physics::Command;
use crate::physics::airframe::ActuatorFigures;

/// The arguments of `greylag replay`.
#[derive(Args)]
pub struct Arguments {
    /// Folder that `greylag fly` or `demo` has recorded.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    #[command(flatten)]
    flown: FlownArguments,
    #[command(flatten)]
    json: JsonArgument,
}

/// Options that replace the recording's own entries on controller, model and link.
#[derive(Args, Debug)]
pub struct FlownArguments {
    /// Controller that flew [default: as recorded, else hybrid-ilqr].
    #[arg(long, value_name = "NAME", value_parser = choices::controller())]
    controller: Option<ControllerKind>,
    /// Model that the controller was designed from [default: as recorded].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Folder of the trained policy, for controllers that need one [default: as recorded].
    #[arg(long, value_name = "DIR")]
    policy: Option<PathBuf>,
    /// Settings of the planner that differed from the defaults [default: as recorded].
    #[arg(long = "planner", value_name = "KEY=VALUE", num_args = 1..)]
    changes: Vec<Change>,
    /// Airframe file in place of the one that the model names [default: as recorded].
    #[arg(long, value_name = "FILE")]
    airframe: Option<PathBuf>,
    /// Schedule that was flown [default: as recorded].
    #[arg(long, value_name = "FILE")]
    schedule: Option<PathBuf>,
    /// Profile of the vehicle's link [default: as recorded, else sitl].
    #[arg(long, value_name = "NAME", value_enum)]
    profile: Option<ProfileName>,
    /// Quantity commanded to a real flight controller [default: as recorded, else surfaces].
    #[arg(long, value_name = "WHAT", value_enum)]
    command: Option<CommandName>,
}

/// Model and controllers that flew a recording, ready to fly it again.
#[cfg_attr(
    not(feature = "demo"),
    expect(dead_code, reason = "pages are drawn with the simulator built in")
)]
pub struct Again {
    /// Controller that flew.
    pub controller: ControllerKind,
    /// Model of the aircraft.
    pub model: GreyBox,
    /// Path of the model's file.
    pub model_file: PathBuf,
    /// Pilot and controllers, as at the start of the flight.
    pub companion: Companion,
    /// The other end of the vehicle's link.
    pub vehicle: Vehicle,
}

impl FlownArguments {
    /// Model and controller of the recording in `folder`. Options replace the entries of the recording.
    ///
    /// # Errors
    /// If the model, policy, schedule or options of the recording cannot be read or are invalid.
    pub fn again(&self, folder: &Path) -> Result<Again> {
        let said = FlownWith::read(folder)?;
        let said = said.as_ref();
        let path = |given: &Option<PathBuf>, said: Option<&PathBuf>, usual: &str| {
            given.as_ref().or(said).cloned().unwrap_or_else(|| usual.into())
        };
        let file = path(&self.model, said.map(|s| &s.model), fly::MODEL);
        let airframe = self.airframe.as_ref().or(said.and_then(|s| s.airframe.as_ref()));
        let mut model = fly::model(&file, airframe.map(PathBuf::as_path))?;
        if self.model.is_none()
            && let Some(note) = said.and_then(|s| s.changed_model(&model))
        {
            eprintln!("{note}");
        }
        let profile = self.profile.or(said.map(|s| s.profile)).unwrap_or(ProfileName::Sitl);
        if profile.stack().is_some() {
            model = model.leaving_rudder();
        }
        let controller = match (self.controller, said) {
            (Some(kind), _) => kind,
            (None, Some(said)) => said.kind()?,
            (None, None) => fly::CONTROLLER.parse()?,
        };
        let changes = match said {
            // another controller may not have these settings
            Some(said) if self.changes.is_empty() && self.controller.is_none() => said.changes()?,
            _ => self.changes.clone(),
        };
        let policy = path(&self.policy, said.map(|s| &s.policy), controllers::POLICY);
        let mut companion = fly::companion_with_planner(controller, &model, &policy, &changes)?;
        let schedule = self.schedule.as_ref().or(said.and_then(|s| s.schedule.as_ref()));
        if let Some(path) = schedule {
            companion.pilot.follow(Schedule::load(path)?);
        }
        let command = self.command.or(said.map(|s| s.commanded)).unwrap_or(CommandName::Surfaces);
        let vehicle = vehicle(profile, command, &model);
        Ok(Again { controller, model, model_file: file, companion, vehicle })
    }
}

/// The result as JSON.
#[derive(Serialize)]
struct Document {
    ticks: u64,
    different: u64,
    plans_different: u64,
    without_state: u64,
    cut_short: bool,
    differences: Vec<Differing>,
}

/// A command that differs from the recorded one: aileron, elevator, throttle, rudder.
#[derive(Serialize)]
struct Differing {
    time_s: f64,
    recorded: [f64; 4],
    replayed: [f64; 4],
}

impl From<&Outcome> for Document {
    fn from(of: &Outcome) -> Document {
        let all = |c: &Command| [c.aileron, c.elevator, c.throttle, c.rudder];
        let differing = |d: &Difference| Differing {
            time_s: d.time.as_secs_f64(),
            recorded: all(&d.recorded),
            replayed: all(&d.replayed),
        };
        Document {
            ticks: of.ticks,
            different: of.different,
            plans_different: of.plans_different,
            without_state: of.without_state,
            cut_short: of.cut_short,
            differences: of.differences.iter().map(differing).collect(),
        }
    }
}

/// Replays the flight. The exit status is 0 if every command equals the recorded one.
///
/// # Errors
/// If a file of the recording, the model or the policy cannot be read or is invalid.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    arguments.json.writable(Overwrite::New)?;
    let Again { companion, vehicle, .. } = arguments.flown.again(&arguments.folder)?;
    let outcome = replay(&arguments.folder, companion, vehicle)?;
    if !arguments.json.takes_stdout() {
        print(&outcome);
    }
    arguments.json.write("greylag.replay/1", &Document::from(&outcome), Overwrite::New)?;
    let exact = outcome.different == 0 && outcome.without_state <= u64::from(outcome.cut_short);
    Ok(if exact && outcome.ticks > 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn vehicle(profile: ProfileName, command: CommandName, model: &GreyBox) -> Vehicle {
    let figures = model.airframe.actuators;
    match profile.stack() {
        None => Vehicle::Sitl(Sitl::new(1, figures.travels())),
        Some(stack) => {
            let actuators = ActuatorFigures { rudder: None, ..figures };
            let authority = command.authority();
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
        let words = |c: &Command| {
            format!("{:+.6} {:+.6} {:.6} {:+.6}", c.aileron, c.elevator, c.throttle, c.rudder)
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
