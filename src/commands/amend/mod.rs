//! `greylag amend`: refits a model to flights and adds missing effects.
//!
//! An effect is a term of the equations of motion from the catalogue. A diagnosis asserts the effects that it finds missing.

mod bounds;
mod caller;
mod given;
mod leave_one_out;
mod page;
mod places;
mod suspect;
mod tables;
mod unasserted;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};

pub use caller::Caller;
use page::page;
use places::{Made, Places, hashed};
use tables::print;

use crate::commands::bar::{Bar, shares};
use crate::commands::distinct::{distinct, distinct_names};
use crate::commands::effect_files::{effect_paths, named_effects, own_effects};
use crate::commands::files::{self, shipped};
use crate::commands::given as read;
use crate::commands::held_out;
use crate::commands::intake::{Intake, LogArguments};
use crate::commands::outputs;
use crate::commands::per_flight::FitConstantsArguments;
use crate::commands::status::IN_DOUBT;
use crate::commands::terminal::noted;
use crate::logs::quoted;
use crate::model::GreyBox;
use crate::physics::catalogue;
use crate::sysid::amend::document::{MODEL, STORY};
use crate::sysid::amend::{self, Added, Amendment, Prior, Refused};
use crate::sysid::diagnose::{self, diagnose};
use crate::sysid::flight_path::ActuatorClock;
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::progress::{Stage, part};

/// File name of the errors that `--leave-one-out` finds.
const LEAVE_ONE_OUT: &str = "leave-one-out.json";

/// Options of `greylag amend`.
#[derive(clap::Args)]
#[command(
    group = clap::ArgGroup::new("what").required(true).multiple(true),
    after_help = "Exit status: 0 written; 1 an error, or every effect was refused: nothing was written; 3 not written, for the fit predicts the flights held out worse than the model as given or not better with 95 % confidence, or written, but an effect was refused, a coefficient ended at a bound, a log was left out or flights contradict one another."
)]
pub struct Arguments {
    /// Model file to start from; it stays as it is.
    #[arg(long, env = "GREYLAG_MODEL", hide_env_values = true)]
    model: PathBuf,
    #[command(flatten)]
    logs: LogArguments,
    /// Logs for validation, which the fit does not see [default: the last log, or the last third of a single log].
    #[arg(long, num_args = 1..)]
    hold_out: Vec<PathBuf>,
    /// Diagnose these logs, and add the effects that the diagnosis asserts to be missing.
    #[arg(long, group = "what", conflicts_with = "diagnosis")]
    accept: bool,
    /// Add the effects that this diagnosis asserts to be missing: a file written by `greylag diagnose --json`.
    #[arg(long, group = "what", value_name = "JSON")]
    diagnosis: Option<PathBuf>,
    /// Add these effects, in this order: ids of the catalogue, or effect files (TOML). They follow the effects of --accept or
    /// --diagnosis.
    #[arg(long = "effect", value_name = "ID|FILE", num_args = 1.., group = "what")]
    effects: Vec<String>,
    /// Add nothing: fit the model's own coefficients.
    #[arg(long, group = "what", conflicts_with_all = ["accept", "diagnosis", "effects"])]
    tune_only: bool,
    /// Also try other model structure options (integrator, axes of the forces, standard atmosphere). The integrator and the axes
    /// are changed if the flights support it, the atmosphere unless the flights contradict it.
    #[arg(long)]
    conventions: bool,
    /// Use only physical bounds as prior: all coefficients in which the model is linear are free, including those that are zero.
    /// For a model whose numbers are guesses.
    #[arg(long)]
    from_scratch: bool,
    #[command(flatten)]
    per_flight: FitConstantsArguments,
    /// Bound a coefficient by LEAST and MOST in place of the catalogue's bounds for an aircraft of this size, such as
    /// lift_linear.CL0=-2..2. The file of the amended model records the bounds.
    #[arg(long = "bound", value_name = "NAME=LEAST..MOST", num_args = 1.., value_parser = bounds::bound)]
    bounds: Vec<bounds::Bound>,
    /// Multiply the standard deviations of the coefficients' priors by this factor.
    #[arg(long, value_name = "FACTOR", conflicts_with = "from_scratch")]
    widths: Option<f64>,
    /// Write the fit even if it predicts the held-out flights no better, and add effects that would be refused.
    #[arg(long)]
    accept_anyway: bool,
    /// Fit to all logs: nothing is held out, so the printed errors are those of the fitted flights.
    #[arg(long, conflicts_with = "hold_out")]
    fit_all: bool,
    /// Write no model. Predict each log by a fit to all others, for several structures: as given, refitted, with constants per
    /// flight, wider priors, from scratch, each effect added. Report the simplest within one standard error of the best.
    #[arg(long, conflicts_with_all = ["hold_out", "fit_all", "conventions", "from_scratch", "widths", "report", "accept_anyway"])]
    leave_one_out: bool,
    /// Folder for model.toml, the airframe and amend.json, or for leave-one-out.json; created if missing.
    #[arg(long)]
    out: PathBuf,
    /// Write the report as one HTML page.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Replace files that already exist.
    #[arg(long)]
    force: bool,
}

/// Reads the logs, reconstructs the flight paths and fits the model. Prints the prediction errors before and after the fit, and
/// writes the model.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    run_for(arguments, Caller::Amend)
}

/// The same as [`run`], for the command `caller`.
pub fn run_for(arguments: &Arguments, caller: Caller) -> Result<ExitCode> {
    let path = shipped(&arguments.model);
    let overwrite = arguments.force.into();
    let model = bounds::given(read::model(&arguments.model)?, &arguments.bounds)?;
    let model = bounds::widened(model, arguments.widths)?;
    if arguments.leave_one_out {
        return structures(arguments, &model);
    }
    arguments.check_outputs(&[MODEL, STORY])?;
    let places = Places::new(&path, &model, &arguments.out, overwrite)?;
    arguments.check_logs()?;
    let effects = named_effects(&arguments.effects)?;
    check_new(&effects, &model)?;
    let (paths, held) = divided(arguments);
    let (logs, hold_out) = (hashed(&paths)?, hashed(&held)?);
    let fitted = arguments.logs.of(paths);
    let mut taken = fitted.take_in(&model, ActuatorClock::AsRecorded)?;
    let tests = tests(arguments, held, &model, &mut taken)?;
    let Intake { flights, notes, mut in_doubt, used, .. } = taken;
    let options = options(arguments, wanted(arguments, &effects, &model, &flights)?);
    let bar = Bar::new();
    let on_stage = |stage: Stage<'_>| bar.update(stage);
    let [fitting, drawing] = shares(arguments.report.as_deref());
    let mut amended = amend::amend(&model, &flights, &tests, &options, &part(&on_stage, fitting))?;
    let story = &mut amended.amendment;
    let suspect = suspect::notes(story, &model);
    in_doubt |= doubtful(story);
    story.notes.splice(0..0, notes.into_iter().chain(suspect));
    let all_refused = story.all_refused();
    let kept = given_is_kept(arguments, story).filter(|_| !all_refused);
    let answer = amended.amendment.answer.clone().then(next(&fitted.among(&used), &places));
    // the page is drawn before any file is written, so that Ctrl-C during the drawing leaves no file behind
    let results = (&places, &answer);
    let draw = || page(arguments, &model, &amended, &tests, results, &part(&on_stage, drawing));
    let drawn = match &arguments.report {
        Some(path) if !all_refused && kept.is_none() => Some((path, draw()?)),
        _ => None,
    };
    bar.go_on()?;
    drop(bar);
    if let Some(why) = &kept {
        println!("{why} {}\n", caller.unwritten());
    }
    print(&amended.amendment, &answer);
    if all_refused {
        bail!(
            "no effect was accepted, so nothing was written; --tune-only writes the tuned model, \
             --accept-anyway writes a refused effect"
        );
    }
    if kept.is_some() {
        return Ok(ExitCode::from(IN_DOUBT));
    }
    places.write(&model, &amended, [&logs, &hold_out], overwrite)?;
    if let Some((path, page)) = drawn {
        files::write(path, &page, overwrite)?;
    }
    caller.print_summary(&answer);
    Ok(if in_doubt { ExitCode::from(IN_DOUBT) } else { ExitCode::SUCCESS })
}

impl Arguments {
    /// Checks the page and the files `names` in the folder for the results, see [`outputs::check`]. Whether the files in the
    /// folder can be written is checked when the folder exists.
    fn check_outputs(&self, names: &[&str]) -> Result<()> {
        let logs = self.logs.files().chain(&self.hold_out).chain(&self.diagnosis).cloned();
        let mut inputs = read::files(&self.model);
        inputs.extend(logs.chain(effect_paths(&self.effects)));
        let results = names.iter().map(|name| self.out.join(name));
        let all: Vec<PathBuf> = results.chain(self.report.clone()).collect();
        outputs::separate(&all, &inputs)?;
        self.report.iter().try_for_each(|path| files::writable(path, self.force.into()))
    }

    /// Checks that no log is named twice and, if constants are estimated per flight, that all file names differ.
    fn check_logs(&self) -> Result<()> {
        distinct(&self.logs.paths, &self.hold_out)?;
        match self.per_flight.asked().constants().is_empty() {
            true => Ok(()),
            false => distinct_names(self.logs.paths.iter().chain(&self.hold_out)),
        }
    }
}

/// The reason why the fit is not written, in a sentence; `None` if it is written. With `--fit-all` no flight is held out, so an
/// improvement by chance cannot be detected. With `--from-scratch` the model as given is a guess, so flights that are too short
/// to exclude an improvement by chance are no reason to keep it.
fn given_is_kept(arguments: &Arguments, story: &Amendment) -> Option<String> {
    let by_chance = || story.by_chance().filter(|_| !arguments.fit_all);
    let unjudged = || story.unjudged().filter(|_| !arguments.fit_all && !arguments.from_scratch);
    story.worse().or_else(by_chance).or_else(unjudged).filter(|_| !arguments.accept_anyway)
}

/// The command to run next: a diagnosis of the amended model with `logs`, those that were fitted.
fn next(logs: &LogArguments, places: &Places) -> String {
    format!("greylag diagnose --model {}{}", quoted(&places.model()), logs.words())
}

/// Options of the amendment. `effects` are the effects to add.
fn options(arguments: &Arguments, effects: Vec<Added>) -> amend::Options {
    amend::Options {
        effects,
        conventions: arguments.conventions,
        prior: if arguments.from_scratch { Prior::Bounds } else { Prior::File },
        refused: if arguments.accept_anyway { Refused::Kept } else { Refused::Left },
        per_flight: arguments.per_flight.asked(),
        ..amend::Options::default()
    }
}

/// Whether an effect was refused, a coefficient ended at a bound, a control has no effect, or flights contradict one another.
fn doubtful(story: &Amendment) -> bool {
    story.effects.iter().any(|e| !e.refused.is_empty())
        || story.parameters.iter().any(|p| p.at_bound)
        || suspect::without_effect(&story.parameters).is_some()
        || !amend::contradictions(&story.parameters).is_empty()
}

/// Carries out `--leave-one-out`: prints a table of structures and writes no model.
fn structures(arguments: &Arguments, model: &GreyBox) -> Result<ExitCode> {
    let overwrite = arguments.force.into();
    // with a log given twice, the fit would see a copy of the flight that is left out
    distinct(&arguments.logs.paths, &[])?;
    arguments.check_outputs(&[LEAVE_ONE_OUT])?;
    let json = arguments.out.join(LEAVE_ONE_OUT);
    let made = Made::folder(&arguments.out)?;
    files::writable(&json, overwrite)?;
    drop(made);
    let effects = named_effects(&arguments.effects)?;
    check_new(&effects, model)?;
    let taken = arguments.logs.take_in(model, ActuatorClock::AsRecorded)?;
    let effects = wanted(arguments, &effects, model, &taken.flights)?;
    let all = leave_one_out::structures(model, &effects, arguments.per_flight.asked());
    let done = leave_one_out::run(model, &taken.flights, &all, Some(&json), overwrite)?;
    taken.notes.iter().for_each(|note| println!("{}", noted(note)));
    Ok(if taken.in_doubt { ExitCode::from(IN_DOUBT) } else { done })
}

/// Refuses effects that are unknown to the program or already in the model.
fn check_new(effects: &[String], model: &GreyBox) -> Result<()> {
    for id in effects {
        if catalogue::describe(id).is_none() {
            bail!(
                "effect {id:?} is unknown to this program; `greylag effects list` names those it knows"
            );
        }
        if model.has(id) {
            bail!(
                "model {} has the effect {id} already; --tune-only refits its coefficients",
                model.name
            );
        }
    }
    Ok(())
}

/// The flights for validation. With `--fit-all`, the fitted flights are returned.
fn tests(
    arguments: &Arguments,
    held: Vec<PathBuf>,
    model: &GreyBox,
    taken: &mut Intake,
) -> Result<Vec<Reconstruction>> {
    if arguments.fit_all {
        taken.notes.push(
            "fitted to all logs: the errors are those of flights that the fit has seen".into(),
        );
        return Ok(taken.flights.clone());
    }
    held_out::validation(&arguments.logs, held, (model, ActuatorClock::AsRecorded), taken)
}

/// Logs for the fit and logs for validation. With `--fit-all` all logs are for both.
fn divided(arguments: &Arguments) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let logs = &arguments.logs.paths;
    match arguments.fit_all {
        true => (logs.clone(), logs.clone()),
        false => held_out::divided(logs, &arguments.hold_out),
    }
}

/// The effects to add: those asserted by a diagnosis, then those named by options.
fn wanted(
    arguments: &Arguments,
    effects: &[String],
    model: &GreyBox,
    flights: &[Reconstruction],
) -> Result<Vec<Added>> {
    let mut all = Vec::new();
    if arguments.accept {
        let (with, per_flight) = (own_effects(effects), arguments.per_flight.asked());
        let options = diagnose::Options { with, per_flight, ..Default::default() };
        let bar = Bar::new();
        let diagnosis = diagnose(model, flights, &options, &|stage| bar.update(stage))?;
        all.extend(diagnosis.effects.iter().filter(|c| c.asserted).map(Added::of));
        if all.is_empty() {
            bail!(unasserted::message(arguments, &diagnosis));
        }
    }
    if let Some(path) = &arguments.diagnosis {
        all.extend(given::asserted(path, &model.name)?);
        if all.is_empty() {
            bail!("the diagnosis {} asserts no effect, so there is none to add", path.display());
        }
    }
    for id in effects {
        if all.iter().all(|added: &Added| added.id != *id) {
            all.push(Added { id: id.clone(), start: None });
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::{Command, command_of};

    #[test]
    fn a_flight_that_is_left_out_is_in_no_copy() {
        let folder = tempfile::tempdir().unwrap();
        let [one, copy] = ["a.csv", "copy.csv"].map(|name| folder.path().join(name));
        for path in [&one, &copy] {
            std::fs::write(path, "1").unwrap();
        }
        let out = folder.path().join("out");
        let words = ["amend", "--tune-only", "--leave-one-out", "--model", "params/x8/prior.toml"];
        let mut line: Vec<std::ffi::OsString> = words.map(Into::into).into();
        line.extend(["--log".into(), one.into_os_string(), copy.into_os_string()]);
        line.extend(["--out".into(), out.clone().into_os_string()]);
        let Ok(Command::Amend(arguments)) = command_of(&line) else { panic!("no amendment") };
        let error = run(&arguments).unwrap_err().to_string();
        assert!(error.contains("hold the same flight") && !out.exists(), "{error}");
    }
}
