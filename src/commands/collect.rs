//! `greylag collect`: flies exploratory episodes in JSBSim. Models are learned from these episodes.
//!
//! The episodes are collected in rounds. After each round a model is learned, and the next round is planned with it.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::{Context, Result, bail};
use rayon::prelude::*;

use greylag_sitl::plant::PlantOptions;
use greylag_sitl::plant_arguments::PlantArgs;

use crate::commands::files::shipped;
use crate::commands::interruption::{Ended, Interruption};
use crate::commands::start::{self, StartArguments};
use crate::control::{self, ControllerKind};
use crate::logs::csv;
use crate::model::GreyBox;
use crate::sim::Simulator;
use crate::sim::collect::{Place, explore};

/// File in a round's folder with the options that its episodes share.
const OPTIONS: &str = "options.txt";

/// Options of `greylag collect`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Folder of all rounds. The episodes of a round are written into its subfolder `round-NN`.
    #[arg(long)]
    out: PathBuf,
    /// Number of the round. Round 0 is random or flown by --controller. Later rounds are planned by CEM-MPC with `--model`;
    /// half of the actions of round 1 are random, a quarter of those of round 2, and so on.
    #[arg(long, default_value_t = 0)]
    round: u32,
    /// Number of episodes of 1000 steps [default: 175 in round 0, else 25, as in the paper].
    #[arg(long)]
    episodes: Option<u32>,
    /// Model that later rounds are planned with: the last one trained. With --controller: a model of the aircraft, from which
    /// its cruise airspeed and rudder are taken.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Controller that flies round 0 towards random attitudes, with half of the actions random: `any` or `adaptive`, which
    /// need no model of the aircraft's dynamics. Without a controller all actions of round 0 are random.
    #[arg(long, value_name = "NAME", requires = "model")]
    controller: Option<Explorer>,
    /// Seed of targets and actions.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    #[command(flatten)]
    plant: PlantArgs,
    #[command(flatten)]
    start: StartArguments,
}

/// A controller that explores an aircraft without a model of its dynamics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Explorer {
    /// The policy for any aircraft.
    Any,
    /// The adaptive attitude hold.
    Adaptive,
}

impl Explorer {
    /// The controller's name on the command line.
    pub fn name(self) -> &'static str {
        self.kind().name()
    }

    fn kind(self) -> ControllerKind {
        match self {
            Explorer::Any => ControllerKind::Any,
            Explorer::Adaptive => ControllerKind::Adaptive,
        }
    }
}

/// Simulates the episodes that have no file yet.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    Ok(fly(arguments, &Interruption::watch()?)?.into())
}

/// Simulates the episodes that have no file yet, until `stop` is set.
pub fn fly(arguments: &Arguments, stop: &Interruption) -> Result<Ended> {
    let load = |path: &PathBuf| GreyBox::load(&shipped(path));
    let models: Vec<GreyBox> = arguments.model.iter().map(load).collect::<Result<_, _>>()?;
    let controller = match (models.first(), arguments.round, arguments.controller) {
        (None, 0, _) => None,
        (Some(model), 0, Some(explorer)) => Some(control::build(explorer.kind(), model)?),
        (Some(_), 0, None) => bail!(
            "round 0 is random and takes no --model; give --round 1 or later, or --controller any"
        ),
        (Some(model), _, None) => Some(control::build(ControllerKind::Cem, model)?),
        (Some(_), round, Some(_)) => {
            bail!("--controller flies round 0; round {round} is planned with --model")
        }
        (None, round, _) => {
            bail!("round {round} is planned: give the model to plan with, --model")
        }
    };
    let folder = arguments.out.join(format!("round-{:02}", arguments.round));
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot make {}", folder.display()))?;
    let count = arguments.episodes.unwrap_or(if arguments.round == 0 { 175 } else { 25 });
    let mut plant = arguments.plant.options(arguments.seed);
    start::describe(&mut plant, &models)?;
    plant.start = arguments.start.start(&plant.aircraft, &models)?;
    start::introduce(&plant, &models)?;
    keep_options(&folder, &shared_options(arguments, &plant))?;
    let flown = AtomicU32::new(0);
    (0..count).into_par_iter().try_for_each_init(
        || (Simulator::new(&plant), controller.as_ref().map(|c| c.boxed_clone())),
        |(simulator, controller), episode| -> Result<()> {
            let path = folder.join(format!("episode-{episode:03}.csv"));
            if stop.is_set() || path.exists() {
                return Ok(());
            }
            let simulator = simulator.as_mut().map_err(|e| anyhow::anyhow!("{e}"))?;
            let place = Place { seed: arguments.seed.into(), round: arguments.round, episode };
            let controller =
                controller.as_mut().map(|c| c.as_mut() as &mut dyn control::Controller);
            let flight = explore(simulator, controller, &place)?;
            save(&flight, &path)?;
            let done = flown.fetch_add(1, Ordering::Relaxed) + 1;
            if done.is_multiple_of(25) {
                eprintln!("{done} episodes flown");
            }
            Ok(())
        },
    )?;
    let there = (0..count).filter(|e| folder.join(format!("episode-{e:03}.csv")).exists()).count();
    println!("{} episodes flown, {there} of {count} in {}", flown.into_inner(), folder.display());
    if stop.is_set() {
        eprintln!("interrupted; the same command flies the rest");
        return Ok(Ended::Interrupted);
    }
    Ok(Ended::Done)
}

/// Writes the file of an episode completely or not at all. A file therefore shows that its episode is complete.
fn save(flight: &crate::logs::Flight, path: &Path) -> Result<()> {
    let part = path.with_extension("part");
    let _ = std::fs::remove_file(&part);
    csv::save(flight, &part)?;
    std::fs::rename(&part, path).with_context(|| format!("cannot write {}", path.display()))
}

/// The options that the episodes of a round share, one per line. The model is omitted, because its path can be written in
/// several ways.
fn shared_options(arguments: &Arguments, plant: &PlantOptions) -> String {
    let hidden: Vec<String> = plant.hidden.iter().map(ToString::to_string).collect();
    format!(
        "seed {}\naircraft {}\nhidden {}\nset {:?}\nair {:?}\nstart {} m/s, {} m\ncontroller {}\n",
        arguments.seed,
        plant.aircraft,
        hidden.join(" "),
        plant.held,
        plant.air,
        plant.start.airspeed_mps,
        plant.start.altitude_m,
        arguments.controller.map_or("none", Explorer::name)
    )
}

/// Stores `options` in `folder`. If the folder already holds episodes, compares `options` with the stored options instead.
///
/// # Errors
/// If the folder holds episodes that were flown with other options. Episodes without stored options are accepted, because
/// earlier versions stored none.
fn keep_options(folder: &Path, options: &str) -> Result<()> {
    let path = folder.join(OPTIONS);
    let entries = std::fs::read_dir(folder)
        .with_context(|| format!("cannot read {}", folder.display()))?
        .collect::<std::io::Result<Vec<_>>>()?;
    let flown = entries.iter().any(|entry| entry.path().extension().is_some_and(|e| e == "csv"));
    if flown && !path.exists() {
        return Ok(());
    }
    if flown {
        let there = std::fs::read_to_string(&path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        let differs = there.lines().zip(options.lines()).find(|(there, here)| there != here);
        if let Some((there, here)) = differs {
            bail!(
                "{} holds episodes with `{there}`, not `{here}`; give another --out, or the same options",
                folder.display()
            );
        }
        return Ok(());
    }
    let part = path.with_extension("part");
    std::fs::write(&part, options)
        .and_then(|()| std::fs::rename(&part, &path))
        .with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn episodes_of_other_options_are_not_mixed() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        // Without episodes the options may change.
        keep_options(folder, "seed 1\naircraft x8\n").unwrap();
        keep_options(folder, "seed 2\naircraft x8\n").unwrap();
        std::fs::write(folder.join("episode-000.csv"), "").unwrap();
        keep_options(folder, "seed 2\naircraft x8\n").unwrap();
        let refused = keep_options(folder, "seed 2\naircraft c172p\n").unwrap_err().to_string();
        assert!(refused.contains("`aircraft x8`, not `aircraft c172p`"), "{refused}");
        // An earlier version wrote no options.
        std::fs::remove_file(folder.join(OPTIONS)).unwrap();
        keep_options(folder, "seed 3\naircraft x8\n").unwrap();
        assert!(!folder.join(OPTIONS).exists());
    }
}
