//! `greylag replay`: feeds the telemetry of a recorded flight to the companion again, and compares its commands with the
//! recorded ones bit by bit.
//!
//! The companion is the part of this program that flies: a controller, and a pilot that limits the commands and falls back to a
//! second controller.

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
    /// Folder with a flight recorded by `greylag fly` or `greylag demo`.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    #[command(flatten)]
    flown: FlownArguments,
    #[command(flatten)]
    json: JsonArgument,
}

/// Options that override what the recording states about controller, model and link.
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
    /// Settings of the model-predictive planner that differed from its defaults [default: as recorded].
    #[arg(long = "planner", value_name = "KEY=VALUE", num_args = 1..)]
    changes: Vec<Change>,
    /// Airframe file that replaced the one named by the model file [default: as recorded].
    #[arg(long, value_name = "FILE")]
    airframe: Option<PathBuf>,
    /// Flight-test schedule that was flown [default: as recorded].
    #[arg(long, value_name = "FILE")]
    schedule: Option<PathBuf>,
    /// Kind of autopilot at the other end of the vehicle's link [default: as recorded, else sitl].
    #[arg(long, value_name = "NAME", value_enum)]
    profile: Option<ProfileName>,
    /// Quantity commanded to a real flight controller [default: as recorded, else surfaces].
    #[arg(long, value_name = "WHAT", value_enum)]
    command: Option<CommandName>,
}

/// Model, companion and link codec of a recorded flight, in the state before the flight.
#[cfg_attr(
    not(feature = "demo"),
    expect(dead_code, reason = "pages are drawn with the simulator built in")
)]
pub struct Again {
    /// Kind of controller that flew.
    pub controller: ControllerKind,
    /// Model of the aircraft.
    pub model: GreyBox,
    /// Path of the model's file.
    pub model_file: PathBuf,
    /// Pilot and controllers, as at the start of the flight.
    pub companion: Companion,
    /// Decoder of the vehicle's telemetry and encoder of the commands to it.
    pub vehicle: Vehicle,
}

impl FlownArguments {
    /// Prepares a replay of the recording in `folder`. The options take precedence over the entries of the recording.
    ///
    /// # Errors
    /// If the model, the policy, the schedule or the entries of the recording cannot be read or are invalid.
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
            // the recorded settings may not exist in a controller that the user chose instead
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

/// The result of the replay as it is written to a JSON file.
#[derive(Serialize)]
struct Document {
    ticks: u64,
    different: u64,
    plans_different: u64,
    without_state: u64,
    cut_short: bool,
    differences: Vec<Differing>,
}

/// A recorded command and the different command of the replay, each as aileron, elevator, throttle and rudder.
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

/// Replays the flight. The exit status is 0 if every command equals the recorded one and the telemetry is complete.
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
