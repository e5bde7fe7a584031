//! `greylag train dynamics`: learns a dynamics model from flights.
//!
//! The model is the sum of a prior, a physical model that may be wrong, and a residual, a neural network that corrects it.

mod recipe;
mod tables;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result};
use serde::Serialize;

use super::flights::{FlightArguments, Flights};
use crate::commands::files::{self, Overwrite, shipped};
use crate::commands::interruption::{Ended, Interruption};
use crate::commands::{given, outputs};
use crate::learn::dynamics::export;
use crate::learn::dynamics::residual_map::{ResidualMap, residual_map};
use crate::learn::dynamics::score::{Horizon, free_run};
use crate::learn::{self, Checkpoint, Learned, Moment, Recipe, Trainer};
use crate::logs::quoted;
use crate::model::{GreyBox, Integrator, STEP};
use crate::report::TrainingReport;
use tables::{coefficients, horizons, line, shares};

/// Updates between two progress lines.
const LINE: u64 = 500;
/// Progress lines between two checkpoints.
const KEEP: u64 = 4;
/// Horizons at which the prediction errors of the models are computed, steps of 10 ms.
const HORIZONS: [usize; 4] = [1, 10, 100, 500];
/// Name of the file from which a training is resumed.
const CHECKPOINT: &str = "checkpoint.safetensors";

/// File name of the training's history, which the report shows.
const HISTORY: &str = "history.json";
/// File name of the report.
const REPORT: &str = "training.html";

/// Options of `greylag train dynamics`.
#[derive(clap::Args)]
pub struct Arguments {
    /// The prior's model file.
    #[arg(long)]
    prior: PathBuf,
    #[command(flatten)]
    flights: FlightArguments,
    /// A model with the true coefficients, if they are known; they are displayed beside the learned ones.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Leave the prior's coefficients as they are (the default).
    #[arg(long, conflicts_with = "trainable")]
    freeze: bool,
    /// Coefficients to learn with the residual, the network that corrects the prior: full names (effect.name,
    /// rigid_body.jxz_kgm2) or `all`.
    #[arg(long, num_args = 1.., value_delimiter = ',', value_name = "NAME")]
    trainable: Vec<String>,
    /// Integrator in place of the prior's: jsbsim for flights of the simulator.
    #[arg(long, value_parser = ["rk4", "jsbsim"])]
    integrator: Option<String>,
    /// Loss: scaled, as in the paper, or plain, as in APHYNITY (with --freeze as in PhIHP). Scaled divides the error of each
    /// state by a characteristic scale x_c and penalises the size of the residual relative to the prior. Plain does neither.
    #[arg(long, default_value = "scaled", value_parser = ["scaled", "plain"])]
    loss: String,
    /// Weight each rollout by 1/(e² + FLOOR²), where e is the prior's error at the end of the rollout, divided by
    /// the rms of this error over all rollouts. Rollouts with small errors of the prior then count more. With `inf`
    /// all weights are equal, as in the paper (the default with --loss plain).
    #[arg(long, value_name = "FLOOR")]
    floor: Option<f64>,
    /// Units of the residual's hidden layers.
    #[arg(long, value_delimiter = ',', default_values_t = [64, 64])]
    hidden: Vec<usize>,
    /// Steps of a rollout; several lengths are used in turn, each for an equal part of the updates (a curriculum)
    /// [default: 20; 200 if a log has fewer than 100 samples per second].
    #[arg(long, value_delimiter = ',')]
    steps: Vec<usize>,
    /// Rollouts in a minibatch.
    #[arg(long, default_value_t = 64)]
    batch: usize,
    /// Total number of updates.
    #[arg(long, default_value_t = 20_000)]
    updates: u64,
    /// Learning rate at the start.
    #[arg(long, default_value_t = 3e-3)]
    rate: f64,
    /// Initial learning rate of the prior's coefficients; 0 keeps their initial values [default: 0.003 with
    /// --start as-given and --joint gradient, else 0].
    #[arg(long)]
    prior_rate: Option<f64>,
    /// Initial values of the trained coefficients: from a robust regression (equation-error), or as-given,
    /// as in the paper.
    #[arg(long, default_value = "equation-error", value_parser = ["as-given", "equation-error"])]
    start: String,
    /// With --start as-given, method by which the coefficients are learned along with the residual:
    /// gradient of the rollouts (as in the paper), projection (every 500 updates, the part of the residual
    /// that the prior can represent moves into its coefficients; outliers such as a stall have a lower
    /// weight), or least-squares (the same with equal weights).
    #[arg(long, default_value = "gradient", value_enum)]
    joint: Joint,
    /// With --log: ignore the prior standard deviations of the coefficients, for a prior whose numbers
    /// are guesses. Without this option they are used (15 % if none is stated), and a coefficient of zero
    /// without a standard deviation is fixed.
    #[arg(long)]
    from_scratch: bool,
    /// Initial value λ0 of λ. The size of the residual is penalised with the weight 1/λ.
    #[arg(long, default_value_t = 1.0)]
    lambda: f64,
    /// Factor τ: at each update, λ grows by τ times the normalised loss.
    #[arg(long, default_value_t = 0.02)]
    tau: f64,
    /// Seed of the initial residual and of the minibatches.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for model, checkpoint and scores; a training found there is resumed.
    #[arg(long)]
    out: PathBuf,
}

/// Method by which coefficients are trained together with the residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Joint {
    Gradient,
    Projection,
    LeastSquares,
}

impl From<Joint> for learn::Joint {
    fn from(joint: Joint) -> learn::Joint {
        match joint {
            Joint::Gradient => learn::Joint::Gradient,
            Joint::Projection => learn::Joint::Projection,
            Joint::LeastSquares => learn::Joint::LeastSquares,
        }
    }
}

/// Contents of the file `training.json`.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    program: &'static str,
    recipe: &'a Recipe,
    data_sha256: &'a str,
    unseen: &'a [String],
    coefficients: &'a [Learned],
    history: &'a [Moment],
    prior: Vec<Horizon>,
    learned: Vec<Horizon>,
    residual: Option<ResidualMap>,
    notes: Vec<String>,
}

/// Trains the model, prints the result and writes the model's files.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    Ok(learn(arguments, &Interruption::watch()?)?.into())
}

/// Does the same as [`run`]. If `stop` is set, writes a checkpoint and ends early.
pub fn learn(arguments: &Arguments, stop: &Interruption) -> Result<Ended> {
    let path = shipped(&arguments.prior);
    arguments.check_outputs()?;
    let prior = arguments.prior(&path)?;
    let truth = arguments.truth.as_ref().map(|t| GreyBox::load(&shipped(t))).transpose()?;
    let Flights { learn, judge, samples, slowest_s, notes } = arguments.flights.read(&prior)?;
    let prior = arguments.narrowed(prior);
    let recipe = arguments.recipe(&prior, slowest_s);
    notes.iter().for_each(|note| eprintln!("{note}"));
    std::fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot make {}", arguments.out.display()))?;
    eprintln!(
        "learning from {} flights, {samples} samples; judging by {}",
        learn.len(),
        judge.len()
    );
    let kept = arguments.out.join(CHECKPOINT);
    let mut trainer = begun(Trainer::new(recipe, &prior, learn)?, &kept)?;
    let past = arguments.out.join(HISTORY);
    let mut history = history(&past, trainer.update());
    if !train(&mut trainer, &kept, &past, &mut history, stop)? {
        eprintln!("interrupted; the same command goes on from {}", kept.display());
        return Ok(Ended::Interrupted);
    }
    let model = trainer.model()?;
    let learned = trainer.coefficients(truth.as_ref());
    let names: Vec<String> = learned.iter().map(|c| c.name.clone()).collect();
    let origin = export::origin(&model, trainer.data(), trainer.recipe().seed);
    let about = format!("Learned from {samples} samples of flight, prior {}.", prior.name);
    let text = export::Text { about: &about, trained: &names };
    export::save(&model, &path, text, &origin, &arguments.out)?;
    let scores = [&prior, &model].map(|m| free_run(m, &judge, &HORIZONS));
    let residual = residual_map(&model, &judge);
    let tables = [coefficients(&learned), horizons(&scores)];
    tables.into_iter().chain(residual.as_ref().map(shares)).for_each(|table| println!("{table}"));
    let mut notes = notes;
    if let Some(note) = worse(&scores) {
        eprintln!("{note}");
        notes.push(note);
    }
    let [before, after] = scores;
    let document = Document {
        schema: "greylag.training/1",
        program: concat!("greylag ", env!("CARGO_PKG_VERSION")),
        recipe: trainer.recipe(),
        data_sha256: trainer.data(),
        unseen: trainer.unseen(),
        coefficients: &learned,
        history: &history,
        prior: before,
        learned: after,
        residual,
        notes,
    };
    let title = format!("{} learned from flights", prior.name);
    let subtitle = format!("{} updates over {samples} samples.", trainer.update());
    document.save(&arguments.out, [title, subtitle], &path)?;
    println!("model in {}", arguments.out.join(export::MODEL).display());
    Ok(Ended::Done)
}

impl Document<'_> {
    /// Writes the JSON file and the report into `folder`. `prior` is the path of the prior's file.
    fn save(&self, folder: &Path, [title, subtitle]: [String; 2], prior: &Path) -> Result<()> {
        let json = folder.join("training.json");
        files::write(&json, &(serde_json::to_string_pretty(self)? + "\n"), Overwrite::Force)?;
        let report = TrainingReport {
            title,
            subtitle,
            history: self.history,
            coefficients: self.coefficients,
            prior: &self.prior,
            learned: &self.learned,
            residual: self.residual.as_ref(),
            next: format!(
                "greylag evaluate --controller lqi-damped --model {}",
                quoted(&folder.join(export::MODEL))
            ),
            notes: &self.notes,
            provenance: vec![
                ("Program".into(), self.program.into()),
                ("Prior".into(), prior.display().to_string()),
                ("Data".into(), format!("SHA-256 {}", self.data_sha256)),
                ("Recipe".into(), serde_json::to_string(self.recipe)?),
                ("Command line".into(), files::command_line()),
                ("Plots".into(), "uPlot 1.6.32 (MIT)".into()),
            ],
        };
        let page = folder.join(REPORT);
        files::write(&page, &report.page().render(), Overwrite::Force)?;
        println!("report in {}", page.display());
        Ok(())
    }
}

impl Arguments {
    /// Fails if a file of the learned model would replace one of the prior or of the true model.
    fn check_outputs(&self) -> Result<()> {
        let written = [export::MODEL, export::RESIDUAL].map(|name| self.out.join(name));
        let models = std::iter::once(&self.prior).chain(&self.truth);
        outputs::separate(&written, models.flat_map(|path| given::files(path)))
    }

    /// The prior in `path`, with the integrator that the options request.
    fn prior(&self, path: &Path) -> Result<GreyBox> {
        let mut prior = GreyBox::load(path)?;
        if let Some(scheme) = &self.integrator {
            prior.integrator = if scheme == "rk4" { Integrator::Rk4 } else { Integrator::Jsbsim };
        }
        Ok(prior)
    }

    /// Returns `prior` with a prior standard deviation for each coefficient: the stated one, else 15 % of the value. The model
    /// is returned unchanged with `--from-scratch`, or if flights of `greylag collect` or recent flights are used.
    fn narrowed(&self, prior: GreyBox) -> GreyBox {
        if !self.flights.is_logs_alone() || self.from_scratch {
            return prior;
        }
        // As in `amend`: a flight without identification manoeuvres determines only some of the coefficients.
        prior.with_widths(|c| Some(c.width()).filter(|width| *width > 0.0))
    }
}

/// Returns `trainer`, resumed from the checkpoint `kept` if there is one. Prints the coefficients that the flights do not
/// determine.
fn begun(mut trainer: Trainer, kept: &Path) -> Result<Trainer> {
    for name in trainer.unseen() {
        eprintln!("the flights do not show {name} apart from others: it stays near its prior");
    }
    if kept.exists() {
        trainer
            .resume(Checkpoint::load(kept)?)
            .with_context(|| format!("cannot continue from {}", kept.display()))?;
        eprintln!("going on after {} updates", trainer.update());
    }
    Ok(trainer)
}

/// Warning if the learned model predicts worse than the prior. They are compared at the longest horizon for which a flight is
/// long enough.
fn worse([before, after]: &[Vec<Horizon>; 2]) -> Option<String> {
    let farthest = before.iter().zip(after).rfind(|(_, learned)| learned.runs > 0);
    let (before, _) = farthest.filter(|(b, a)| a.rms > b.rms || a.lost > b.lost)?;
    let seconds = before.steps as f64 * STEP;
    Some(format!(
        "What was learned is worse than the prior {seconds:.0} s ahead on flights that it has not seen: learn from more \
         flights, with longer rollouts (--steps), or fit the prior first (greylag amend --tune-only)."
    ))
}

/// Trains to the end. Returns `false` if interrupted. In both cases the state of the training is in the checkpoint.
fn train(
    trainer: &mut Trainer,
    kept: &Path,
    past: &Path,
    history: &mut Vec<Moment>,
    stop: &Interruption,
) -> Result<bool> {
    let mut lines = 0;
    while !trainer.is_done() {
        let start = Instant::now();
        let before = trainer.update();
        let progress = trainer.run(LINE).with_context(|| match kept.exists() {
            true => format!("the last good state is in {}", kept.display()),
            false => "no checkpoint was written yet".to_owned(),
        })?;
        let made = (trainer.update() - before) as f64;
        println!("{}", line(&progress, trainer, 1e3 * start.elapsed().as_secs_f64() / made));
        history.push(trainer.moment(&progress));
        lines += 1;
        let interrupted = stop.is_set();
        if lines % KEEP == 0 || interrupted || trainer.is_done() {
            // The history is written first. A resumed training drops the entries beyond its checkpoint.
            files::write(past, &serde_json::to_string(&history)?, Overwrite::Force)?;
            trainer.checkpoint().save(kept)?;
        }
        if interrupted && !trainer.is_done() {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Reads the history of the training up to `update`. The history is empty if it cannot be read, because the training does not
/// depend on it.
fn history(path: &Path, update: u64) -> Vec<Moment> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let mut history: Vec<Moment> = serde_json::from_str(&text).unwrap_or_default();
    history.retain(|m| m.update <= update);
    history
}
