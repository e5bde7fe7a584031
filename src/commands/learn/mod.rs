//! `greylag learn`: learns a model and a policy in one command. It starts from a prior, a physical model of the aircraft that
//! may be wrong.

mod budget;
mod controller;
mod imagined;
mod plan;
mod record;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use comfy_table::Table;

use crate::commands::collect::Explorer;
use crate::commands::files::{command_line, shipped};
use crate::commands::interruption::{Ended, Interruption};
use crate::commands::train::share;
use crate::learn::trainable;
use crate::logs::quoted;
use crate::model::GreyBox;
use crate::model::residual::hash;
use budget::{Algorithm, Budget};
use imagined::Reached;
use plan::{Inputs, Recent, Source, Stage};
use record::Record;

/// Options of `greylag learn`.
#[derive(clap::Args)]
#[command(
    after_help = "Stages: flights with random actions; a model learned from them; rounds of flights \
    planned through that model, which is then learned anew from all flights; the last model; a policy with \
    its critics, trained in the model alone; their scores in the model; the folder OUT/controller, which \
    `fly`, `demo` and `evaluate` take as --model OUT/controller/model.toml --policy OUT/controller/policy. \
    Each stage is a command of its own, which is printed; an interrupted learning goes on with the same \
    command; the same seed gives the same model and policy to the bit."
)]
pub struct Arguments {
    /// The prior: a model file that may be wrong.
    #[arg(long, value_name = "FILE", required_unless_present = "earlier")]
    prior: Option<PathBuf>,
    /// Continue an earlier run with recent flights (--log). DIR is the output folder of that run, or a
    /// folder with a model and its policy, such as params/x8/learned. Flights in DIR are used again,
    /// and its policy is trained further. DIR is not changed.
    #[arg(long = "continue", value_name = "DIR", requires = "logs", conflicts_with_all = ["prior", "collect", "algorithm"])]
    earlier: Option<PathBuf>,
    /// With --continue: fraction of the training samples that come from the recent flights. 1 ignores the earlier flights.
    #[arg(long, value_name = "PART", default_value_t = 0.5, conflicts_with = "prior", value_parser = share)]
    recent_share: f64,
    /// Fly the training flights in JSBSim.
    #[arg(long, conflicts_with = "logs", required_unless_present = "logs")]
    collect: bool,
    /// Learn from these flight logs; no flights are simulated.
    #[arg(long = "log", value_name = "LOG", num_args = 1..)]
    logs: Vec<PathBuf>,
    /// Folder of all outputs. An interrupted run found there is resumed.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Controller that flies the first flights, as in `greylag collect`; half of the actions are still random. Without a
    /// controller all actions of the first flights are random.
    #[arg(long, value_enum, value_name = "NAME", requires = "collect")]
    explorer: Option<Explorer>,
    /// Number of rounds of flights. The flights of a round are planned with the model learned so far [default: by --budget].
    #[arg(long, conflicts_with = "logs", value_parser = clap::value_parser!(u32).range(0..=20))]
    rounds: Option<u32>,
    /// Training algorithm of the policy.
    #[arg(long, default_value = "analytic", value_enum)]
    algorithm: Algorithm,
    /// Amount of computation: quick, standard (minutes on two cores) or paper (the paper's numbers).
    #[arg(long, default_value = "standard", value_enum)]
    budget: Budget,
    /// Coefficients of the prior that are learned together with the residual, the network that corrects
    /// the prior: full names, `all`, or `none`.
    #[arg(long, num_args = 1.., value_delimiter = ',', default_value = "all", value_name = "NAME")]
    trainable: Vec<String>,
    /// With --log: ignore the prior standard deviations of the coefficients, for a prior whose numbers are guesses.
    #[arg(long, conflicts_with = "collect")]
    from_scratch: bool,
    /// Seed of all random draws.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// Folder with NAME/NAME.xml of the aircraft that flies in JSBSim.
    #[arg(long, value_name = "DIR", requires_all = ["aircraft", "collect"])]
    aircraft_dir: Option<PathBuf>,
    /// Name of the aircraft that flies in JSBSim [default: the X8].
    #[arg(long, value_name = "NAME", requires = "collect")]
    aircraft: Option<String>,
    /// Hide an effect in the simulated aircraft (may be repeated), as in `greylag collect`.
    #[arg(long, value_name = "ID=AMPLITUDE", allow_hyphen_values = true, requires = "collect")]
    hide: Vec<String>,
}

/// Runs the stages of `greylag learn`. Stages that are done are skipped.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let stop = Interruption::watch()?;
    let prior = GreyBox::load(&shipped(&arguments.prior_file()?))?;
    let stages = arguments.stages(&prior)?;
    // errors of the options are reported before the first flight
    stages.iter().try_for_each(|stage| super::check_line(&stage.line))?;
    std::fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot make {}", arguments.out.display()))?;
    let mut record = Record::open(&arguments.out, &stages, &arguments.inputs(&prior)?)?;
    for (k, stage) in stages.iter().enumerate() {
        let place = format!("stage {} of {}: {}", k + 1, stages.len(), stage.what);
        if k < record.done().len() {
            println!("{place}: done before");
            continue;
        }
        println!("{place}\n    {}", stage.command());
        let begun = Instant::now();
        let ended = super::carry_out(&stage.line, &stop).with_context(|| place.clone())?;
        if ended == Ended::Interrupted {
            eprintln!(
                "interrupted in stage {} of {}; the same command goes on there",
                k + 1,
                stages.len()
            );
            return Ok(ended.into());
        }
        record.add(stage, begun.elapsed().as_secs_f64())?;
    }
    arguments.finish(&prior, &stages, &record, &stop)
}

impl Arguments {
    fn stages(&self, prior: &GreyBox) -> Result<Vec<Stage>> {
        let trainable = self.trained(prior)?;
        let source = match &self.earlier {
            Some(folder) => Source::Recent(self.recent(folder)?),
            None if self.collect => {
                Source::Simulator { options: self.aircraft_options(prior), explorer: self.explorer }
            }
            None => Source::Logs(self.logs.clone()),
        };
        let file = self.prior_file()?;
        let inputs = Inputs {
            prior: &file,
            out: &self.out,
            source,
            rounds: self.rounds.unwrap_or(self.budget.sizes().rounds),
            trainable: &trainable,
            from_scratch: self.from_scratch,
            algorithm: self.algorithm,
            budget: self.budget,
            seed: self.seed,
        };
        Ok(inputs.stages())
    }

    /// The file of the prior, or of the model of the earlier run.
    fn prior_file(&self) -> Result<PathBuf> {
        match (&self.prior, &self.earlier) {
            (Some(prior), _) => Ok(prior.clone()),
            (None, Some(folder)) => Ok(flying(folder)?.join("model.toml")),
            (None, None) => bail!("give --prior, or --continue with the folder of a learning"),
        }
    }

    /// The parts of the earlier run in `folder` that this run reuses, with the recent logs.
    fn recent(&self, folder: &Path) -> Result<Recent> {
        let policy = shipped(&flying(folder)?.join(plan::POLICY));
        if !policy.exists() {
            bail!(
                "cannot continue from {}: it has a model and no policy; give the folder of `greylag learn`",
                folder.display()
            );
        }
        let flights = folder.join(plan::FLIGHTS);
        let flights = flights.exists().then_some(flights);
        if flights.is_none() {
            eprintln!(
                "{} holds no flights: the model is learned anew from the recent ones alone",
                folder.display()
            );
        }
        Ok(Recent { flights, policy, logs: self.logs.clone(), share: self.recent_share })
    }

    /// Fingerprints of the inputs of this run: prior, airframe, logs, and the policy that is trained further.
    fn inputs(&self, prior: &GreyBox) -> Result<Vec<String>> {
        let mut hashes = vec![prior.sha256.clone(), format!("{:?}", prior.airframe)];
        let mut files = self.logs.clone();
        if let Some(folder) = &self.earlier {
            files.push(shipped(&flying(folder)?.join(plan::POLICY)).join("actor.safetensors"));
        }
        for file in &files {
            let bytes =
                std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
            hashes.push(hash(&bytes));
        }
        Ok(hashes)
    }

    /// The coefficients that are learned: their full names, or the word `all`.
    fn trained(&self, prior: &GreyBox) -> Result<Vec<String>> {
        let known = trainable(prior);
        let names = match self.trainable.as_slice() {
            [all] if all == "all" => return Ok(vec![all.clone()]),
            [none] if none == "none" => return Ok(Vec::new()),
            names => names,
        };
        match names.iter().find(|name| !known.contains(name)) {
            None => Ok(names.to_vec()),
            Some(name) => bail!(
                "prior {} has no coefficient {name} that can be learned; it has {}",
                prior.name,
                known.join(", ")
            ),
        }
    }

    /// Options that select the simulated aircraft, its hidden effects and its initial airspeed. The airspeed is that of the
    /// prior, because the first flights have no learned model yet.
    fn aircraft_options(&self, prior: &GreyBox) -> Vec<OsString> {
        let mut words: Vec<OsString> = Vec::new();
        let mut add = |name: &str, value: OsString| words.extend([name.into(), value]);
        self.aircraft_dir.iter().for_each(|dir| add("--aircraft-dir", dir.into()));
        self.aircraft.iter().for_each(|name| add("--aircraft", name.into()));
        if self.aircraft.is_some() {
            let airspeed = prior.airframe.reference.airspeed.to_string();
            add("--start-airspeed-mps", airspeed.into());
        }
        self.hide.iter().for_each(|effect| add("--hide", effect.into()));
        words
    }

    /// Scores the learned policy in the learned model, writes both into the controller's folder, and prints the scores.
    fn finish(
        &self,
        prior: &GreyBox,
        stages: &[Stage],
        record: &Record,
        stop: &Interruption,
    ) -> Result<ExitCode> {
        println!("scores in the model, on targets of their own");
        let (model, policy) = (self.out.join(plan::MODEL), self.out.join(plan::POLICY));
        let Some(reached) = imagined::reached(&model, &policy, self.seed, self.budget, stop)?
        else {
            eprintln!("interrupted while scoring; the same command goes on there");
            return Ok(Ended::Interrupted.into());
        };
        println!("{}", scores(&reached));
        let lost = reached.iter().find(|r| r.controller == "policy" && r.divergence_rate > 0.5);
        if let Some(lost) = lost {
            bail!(
                "the policy loses {:.0} % of its flights in the model: the model does not hold, or the training \
                 was too short; collect more flights or give a larger --budget, with another --out",
                100.0 * lost.divergence_rate
            );
        }
        controller::assemble(&self.out, &command_line(), prior, stages, &reached)?;
        println!("{}", times(record));
        let folder = self.out.join(controller::CONTROLLER);
        println!("reports: {}/training.html, {}/policy.html", model.display(), policy.display());
        println!("controller in {}", folder.display());
        println!("{}", worth(&reached, &options(&folder)));
        println!(
            "score it in JSBSim: greylag evaluate --controller policy hybrid-lqi {}",
            options(&folder)
        );
        Ok(ExitCode::SUCCESS)
    }
}

/// Largest fraction of target attitudes that a policy ready to fly may lose. A target is lost if the attitude error in the
/// last part of its flight is above 10°.
const LOST: f64 = 0.02;

/// Verdict on the learned policy in words, with the command that flies it.
fn worth(reached: &[Reached], options: &str) -> String {
    let lost = |name: &str| {
        let row = reached.iter().find(|r| r.controller == name)?;
        Some(100.0 * row.divergence_rate)
    };
    match (lost("policy"), lost("hybrid-lqi")) {
        (Some(policy), hybrid) if policy > 100.0 * LOST => {
            let beside = hybrid.map_or_else(
                || "not flown in the model by this budget".to_owned(),
                |hybrid| format!("loses {hybrid:.0} %"),
            );
            format!(
                "not ready to fly: the policy loses {policy:.0} % of its targets in the model (hybrid-lqi with it: {beside}); \
                 train longer with a larger --budget, or look at it: greylag demo {options}"
            )
        }
        _ => format!("fly it: greylag demo {options}"),
    }
}

/// The folder with the model and the policy of an earlier run: the subfolder `controller` of `folder` if it has a model,
/// else `folder` itself.
fn flying(folder: &Path) -> Result<PathBuf> {
    let places = [folder.join(controller::CONTROLLER), folder.to_owned()];
    let place = places.into_iter().find(|place| shipped(&place.join("model.toml")).exists());
    place.with_context(|| {
        format!(
            "cannot continue from {}: it has no model.toml; give the --out of `greylag learn` that ended",
            folder.display()
        )
    })
}

/// The options with which a command flies the controller in `folder`.
fn options(folder: &Path) -> String {
    let [model, policy] = ["model.toml", plan::POLICY].map(|name| folder.join(name));
    format!("--model {} --policy {}", quoted(&model), quoted(&policy))
}

fn scores(reached: &[Reached]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header([
        "controller",
        "targets",
        "easy, mean °",
        "hard corners, mean °",
        "diverged %",
    ]);
    for r in reached {
        table.add_row([
            r.controller.clone(),
            r.targets.to_string(),
            format!("{:.3}", r.easy_deg),
            format!("{:.3}", r.hard_deg),
            format!("{:.1}", 100.0 * r.divergence_rate),
        ]);
    }
    table
}

fn times(record: &Record) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["stage", "s"]);
    for done in record.done() {
        table.add_row([done.what.clone(), format!("{:.0}", done.seconds)]);
    }
    let all: f64 = record.done().iter().map(|done| done.seconds).sum();
    table.add_row(["all stages".into(), format!("{all:.0}")]);
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reached(controller: &str, divergence_rate: f64) -> Reached {
        let (easy_deg, hard_deg) = (0.2, 1.0);
        Reached { controller: controller.into(), targets: 40, easy_deg, hard_deg, divergence_rate }
    }

    #[test]
    fn a_folder_with_a_space_stays_one_word() {
        let words = options(Path::new("my aircraft"));
        assert_eq!(words, "--model 'my aircraft/model.toml' --policy 'my aircraft/policy'");
    }

    #[test]
    fn a_policy_that_loses_targets_is_not_called_ready_to_fly() {
        let good = worth(&[reached("policy", 0.0), reached("lqi", 0.0)], "--policy x");
        assert_eq!(good, "fly it: greylag demo --policy x");
        let lossy = worth(&[reached("policy", 0.2), reached("lqi", 0.0)], "--policy x");
        assert!(lossy.starts_with("not ready to fly: the policy loses 20 %"), "{lossy}");
        assert!(lossy.contains("not flown in the model by this budget"), "{lossy}");
        let beside = worth(&[reached("policy", 0.2), reached("hybrid-lqi", 0.0)], "");
        assert!(beside.contains("loses 0 %"), "{beside}");
    }
}
