//! `greylag train policy`: train a policy in a model or in JSBSim.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail};
use serde::Serialize;

use super::{analytic, curves};
use crate::commands::files::{self, Overwrite, shipped};
use crate::commands::interruption::{Ended, Interruption};
use crate::control::Controller;
use crate::control::policy::{Actor, Agent, Critic, Evaluated, Origin, Policy};
use crate::learn::policy::learning_curve::{COLUMNS, CURVE, CurveFile, CurvePoint};
use crate::learn::{
    AnalyticRecipe, Hyperparameters, PolicyProgress, PolicyRecipe, PolicyStanding, PolicyTrainer,
    ValuationRecipe, write_whole,
};
use crate::model::GreyBox;
use crate::model::residual::{fingerprint, hash};
use crate::physics::Airframe;
use crate::sim::evaluation::{Evaluation, Make, imagine};
use crate::sim::imagined::Imagination;
use crate::sim::targets::{Row, Stratified};
use crate::sim::world::World;
use crate::sim::{Group, Outcome, TargetFile};

/// The file that a training goes on from.
const CHECKPOINT: &str = "checkpoint.safetensors";
/// The page of the learning curves.
const REPORT: &str = "policy.html";
/// Part of the imagined episodes that may be lost before it is said to be too many.
const MANY: f64 = 0.2;

/// Options of `greylag train policy`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Where to train: model:DIR, model:FILE.toml, or jsbsim.
    #[arg(long = "env", value_name = "ENV")]
    environment: Place,
    /// How: td3, or analytic (the slope of the reward through the model, then critics of the actor found).
    #[arg(long, default_value = "td3", value_parser = ["td3", "analytic"])]
    algorithm: String,
    /// Updates of the critics of the actor that the analytic policy gradient found.
    #[arg(long, default_value_t = ValuationRecipe::default().updates, value_parser = clap::value_parser!(u64).range(1..))]
    valuation: u64,
    /// Updates of the analytic policy gradient.
    #[arg(long, default_value_t = AnalyticRecipe::default().updates)]
    updates: u64,
    /// Steps of a window of the analytic policy gradient.
    #[arg(long, default_value_t = AnalyticRecipe::default().window as u64, value_parser = clap::value_parser!(u64).range(1..=1000))]
    window: u64,
    /// Aircraft flown in parallel for an update of the analytic policy gradient.
    #[arg(long, alias = "flock", default_value_t = AnalyticRecipe::default().instances as u64, value_parser = clap::value_parser!(u64).range(1..=4096))]
    gradient_batch: u64,
    /// Learning rate of the analytic policy gradient at the start.
    #[arg(long, default_value_t = AnalyticRecipe::default().rate)]
    climb: f64,
    /// Errors of roll and pitch (rad) below which the analytic policy gradient rounds the reward off.
    #[arg(long, default_value_t = AnalyticRecipe::default().rounding)]
    rounding: f64,
    /// Price of a change of a command from step to step, by its square, in the analytic policy gradient.
    #[arg(long, default_value_t = AnalyticRecipe::default().effort)]
    effort: f64,
    /// Aircraft imagined at once.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u64).range(1..=4096))]
    instances: u64,
    /// Policies to train, each with a seed of its own, from --seed on; they share the cores.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Seed of the first.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Steps of the environment, all aircraft together; each has one update.
    #[arg(long, default_value_t = 700_000)]
    steps: u64,
    /// Steps of random actions at the start.
    #[arg(long, default_value_t = 10_000)]
    warmup: u64,
    /// Transitions remembered.
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    replay: u64,
    /// Folder of a policy whose actor is trained further by the analytic policy gradient; its layers stand in for
    /// --actor.
    #[arg(long, value_name = "DIR")]
    start: Option<PathBuf>,
    /// Units of the actor's hidden layers.
    #[arg(long, value_delimiter = ',', default_values_t = [300, 300])]
    actor: Vec<usize>,
    /// Units of a critic's hidden layers.
    #[arg(long, value_delimiter = ',', default_values_t = [200, 200, 200])]
    critic: Vec<usize>,
    /// Rows of a minibatch.
    #[arg(long, default_value_t = 256, value_parser = clap::value_parser!(u64).range(1..))]
    batch: u64,
    /// Rate at which the target networks follow.
    #[arg(long, default_value_t = 0.05)]
    tau: f64,
    /// Learning rate of actor and critics.
    #[arg(long, default_value_t = 3e-4)]
    rate: f64,
    /// Discount per step.
    #[arg(long, default_value_t = 0.99)]
    discount: f64,
    /// Standard deviation of the noise that explores.
    #[arg(long, default_value_t = 0.1)]
    exploration: f64,
    /// Standard deviation of the noise that smooths the target policy.
    #[arg(long, default_value_t = 0.2)]
    smoothing: f64,
    /// Part of the targets that lie in the hard corners, 0 to 1; 0 is the paper's.
    #[arg(long, default_value_t = 0.0)]
    corners: f64,
    /// Models, drawn from the widths of the coefficients of --env, in which the analytic policy gradient flies (domain
    /// randomisation); 0: the model itself. The critics are those of the model itself.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=4096))]
    draws: u64,
    /// Steps between two evaluations, flown in what it is trained in.
    #[arg(long, default_value_t = 10_000, value_parser = clap::value_parser!(u64).range(1..))]
    evaluate: u64,
    /// Steps between two checkpoints.
    #[arg(long, default_value_t = 50_000, value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint: u64,
    /// Folder for the policy, its learning curve and the checkpoint (seed-N below it for several seeds);
    /// a training found there goes on.
    #[arg(long)]
    out: PathBuf,
}

/// What a policy is trained in.
#[derive(Clone, Debug)]
enum Place {
    Model(PathBuf),
    Simulator,
}

impl FromStr for Place {
    type Err = String;
    fn from_str(text: &str) -> Result<Place, String> {
        match text.split_once(':') {
            Some(("model", path)) if !path.is_empty() => Ok(Place::Model(path.into())),
            None if text == "jsbsim" => Ok(Place::Simulator),
            _ => Err("give model:DIR, model:FILE.toml or jsbsim".into()),
        }
    }
}

/// What a run says of itself beside its curve.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    program: &'static str,
    command_line: String,
    method: &'a Method<'a>,
    best: &'a Origin,
}

/// How a policy was found.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum Method<'a> {
    Td3(&'a PolicyRecipe),
    Analytic { climb: &'a AnalyticRecipe, valuation: &'a ValuationRecipe },
}

/// Where a policy is trained, found to be whole.
struct Ground {
    model: Option<Arc<GreyBox>>,
    origin: Origin,
    airframe: Airframe,
}

/// Trains, prints the curve, writes the best policy.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    Ok(learn(arguments, &Interruption::watch()?)?.into())
}

/// As [`run`], until `stop` is set.
pub fn learn(arguments: &Arguments, stop: &Interruption) -> Result<Ended> {
    let ground = arguments.ground()?;
    if arguments.draws > 0 && !arguments.is_analytic() {
        bail!("--draws spreads the aircraft of --algorithm analytic over models; TD3 flies one");
    }
    if arguments.start.is_some() && !arguments.is_analytic() {
        bail!("--start trains an actor further by --algorithm analytic; TD3 begins with its own");
    }
    println!("{:>8} {COLUMNS}", "seed");
    let one = |seed: u64| arguments.train(&ground, seed, stop);
    let seeds = arguments.seed..arguments.seed + arguments.seeds;
    // RAYON_NUM_THREADS says how many cores a scheduler has given
    let pool = rayon::ThreadPoolBuilder::new().num_threads(rayon::current_num_threads()).build()?;
    use rayon::prelude::*;
    let seeds: Vec<u64> = seeds.collect();
    let ended = pool.install(|| seeds.into_par_iter().map(one).collect::<Result<Vec<bool>>>());
    let page = arguments.out.join(REPORT);
    match curves::draw(&arguments.out, &page) {
        Ok(()) => println!("report in {}", page.display()),
        // a training that failed at its start has said so
        Err(error) if ended.is_ok() => eprintln!("no learning curves were drawn: {error:#}"),
        Err(_) => (),
    }
    let ended = ended?;
    if ended.contains(&false) {
        eprintln!("interrupted; the same command {}", arguments.next_time());
        return Ok(Ended::Interrupted);
    }
    Ok(Ended::Done)
}

impl Arguments {
    fn recipe(&self, seed: u64) -> PolicyRecipe {
        PolicyRecipe {
            td3: Hyperparameters {
                actor: self.actor.clone(),
                critic: self.critic.clone(),
                discount: self.discount,
                tau: self.tau,
                actor_rate: self.rate,
                critic_rate: self.rate,
                smoothing: self.smoothing,
                exploration: self.exploration,
                batch: self.batch as usize,
                ..Hyperparameters::default()
            },
            steps: self.steps,
            warmup: self.warmup,
            replay: self.replay as usize,
            instances: if matches!(self.environment, Place::Simulator) {
                1
            } else {
                self.instances as usize
            },
            corners: self.corners,
            checkpoint: self.checkpoint,
            seed,
        }
    }

    /// What the same command does after an interruption.
    fn next_time(&self) -> &'static str {
        match self.is_analytic() {
            true => "begins this policy anew",
            false => "goes on from the last checkpoint",
        }
    }

    fn is_analytic(&self) -> bool {
        self.algorithm == "analytic"
    }

    fn analytic(&self, seed: u64) -> AnalyticRecipe {
        AnalyticRecipe {
            actor: self.actor.clone(),
            instances: self.gradient_batch as usize,
            window: self.window as usize,
            updates: self.updates,
            rate: self.climb,
            effort: self.effort,
            rounding: self.rounding,
            corners: self.corners,
            draws: self.draws,
            seed,
            ..AnalyticRecipe::default()
        }
    }

    fn valuation(&self, seed: u64) -> ValuationRecipe {
        ValuationRecipe {
            critic: self.critic.clone(),
            updates: self.valuation,
            instances: self.instances as usize,
            discount: self.discount,
            seed,
            ..ValuationRecipe::default()
        }
    }

    fn ground(&self) -> Result<Ground> {
        let parts =
            [("--discount", self.discount), ("--tau", self.tau), ("--corners", self.corners)];
        for (name, value) in parts {
            if !(0.0..=1.0).contains(&value) || name == "--discount" && value == 1.0 {
                bail!("{name} {value}: give a number from 0 to 1 (--discount below 1)");
            }
        }
        let positive = [
            ("--rate", self.rate),
            ("--climb", self.climb),
            ("--rounding", self.rounding),
            ("--effort", self.effort),
            ("--exploration", self.exploration),
            ("--smoothing", self.smoothing),
        ];
        for (name, value) in positive {
            if !(value.is_finite() && value >= 0.0) {
                bail!("{name} {value}: give a number that is not negative");
            }
        }
        let origin = |airframe, model: &str, model_sha256| Origin {
            schema: Origin::SCHEMA.into(),
            airframe,
            model: model.into(),
            model_sha256,
            seed: self.seed,
            steps: 0,
            evaluation: None,
            program: concat!("greylag ", env!("CARGO_PKG_VERSION")).into(),
        };
        let Place::Model(path) = &self.environment else {
            if self.is_analytic() {
                bail!("JSBSim has no slopes: --algorithm analytic takes --env model:DIR");
            }
            if cfg!(not(feature = "sitl")) {
                bail!("this program was built without JSBSim; train in model:DIR");
            }
            let airframe = GreyBox::load(&shipped(Path::new("params/x8/jsbsim.toml")))?.airframe;
            return Ok(Ground {
                model: None,
                origin: origin(fingerprint(&airframe), "jsbsim", String::new()),
                airframe,
            });
        };
        let mut path = shipped(path);
        if path.is_dir() {
            path = path.join("model.toml");
        }
        let model = GreyBox::load(&path)?;
        let origin = origin(fingerprint(&model.airframe), &model.name, model.sha256.clone());
        let airframe = model.airframe.clone();
        Ok(Ground { model: Some(Arc::new(model)), origin, airframe })
    }

    /// The actor that is trained further, if any.
    fn started(&self, airframe: &Airframe) -> Result<Option<Arc<Actor>>> {
        let load = |folder: &PathBuf| -> Result<Arc<Actor>> {
            let agent = Agent::load(folder, airframe)
                .with_context(|| format!("cannot go on from the policy in {}", folder.display()))?;
            Ok(agent.actor)
        };
        self.start.as_ref().map(load).transpose()
    }

    /// Trains the policy of one seed; `false` if interrupted.
    fn train(&self, ground: &Ground, seed: u64, stop: &Interruption) -> Result<bool> {
        let folder = match self.seeds {
            1 => self.out.clone(),
            _ => self.out.join(format!("seed-{seed}")),
        };
        std::fs::create_dir_all(&folder)
            .with_context(|| format!("cannot make {}", folder.display()))?;
        let targets = Stratified::new(seed, 0, self.corners).at_airspeeds_of(&ground.airframe);
        let run = Run { folder, seed, evaluate: self.evaluate, ground, stop };
        let recipe = self.recipe(seed);
        match &ground.model {
            Some(model) if self.is_analytic() => {
                let world = Imagination::new(model.clone(), self.instances as usize, targets);
                let mut recipe = self.analytic(seed);
                let from = self.started(&ground.airframe)?;
                if let Some(actor) = &from {
                    let sizes = actor.network().sizes();
                    recipe.actor = sizes[1..sizes.len() - 1].to_vec();
                }
                run.climb(&recipe, from.as_deref(), self.valuation(seed), model, world)
            }
            Some(model) => {
                run.train(recipe, Imagination::new(model.clone(), self.instances as usize, targets))
            }
            #[cfg(feature = "sitl")]
            None => {
                let plant = greylag_sitl::plant::PlantOptions::default();
                run.train(recipe, crate::sim::flown::Flown::new(&plant, targets)?)
            }
            #[cfg(not(feature = "sitl"))]
            None => Err(anyhow!("this program was built without JSBSim")),
        }
    }
}

/// The training of one policy.
struct Run<'a> {
    folder: PathBuf,
    seed: u64,
    evaluate: u64,
    ground: &'a Ground,
    stop: &'a Interruption,
}

impl Run<'_> {
    /// An actor up the reward's slope, then its critics.
    fn climb(
        &self,
        recipe: &AnalyticRecipe,
        from: Option<&Actor>,
        valuation: ValuationRecipe,
        model: &GreyBox,
        world: Imagination,
    ) -> Result<bool> {
        let judge = |actor| self.ground.evaluate(actor);
        let Some(actor) = analytic::climb(recipe, from, model, &self.folder, &judge, self.stop)?
        else {
            return Ok(false);
        };
        let method = Method::Analytic { climb: recipe, valuation: &valuation.clone() };
        let Some(critics) = analytic::value(valuation, &actor, world, self.stop)? else {
            return Ok(false);
        };
        let steps = recipe.updates * (recipe.window * recipe.instances) as u64;
        let evaluated = self.ground.evaluate(actor.clone())?;
        self.save(&method, actor, critics.into(), steps, evaluated)?;
        println!("{:>8} policy in {}", self.seed, self.folder.display());
        Ok(true)
    }

    fn train<W: World>(&self, recipe: PolicyRecipe, world: W) -> Result<bool> {
        // more steps of the same training are the same training
        let of = PolicyRecipe { steps: 0, ..recipe.clone() };
        let of = (of, &self.ground.origin.model_sha256);
        let what = serde_json::to_string(&of)?;
        let mut trainer = PolicyTrainer::new(recipe, world, hash(what.as_bytes()))?;
        let kept = self.folder.join(CHECKPOINT);
        if kept.exists() {
            let standing = PolicyStanding::load(&kept)?;
            trainer
                .resume(standing)
                .with_context(|| format!("going on from {}", kept.display()))?;
            eprintln!("seed {}: going on after {} steps", self.seed, trainer.steps());
        }
        let path = self.folder.join(CURVE);
        let context = || format!("cannot write {}", path.display());
        let mut curve = CurveFile::open(&path, trainer.steps()).with_context(context)?;
        let (mut best, before) = (curve.best(), curve.seconds());
        let start = Instant::now();
        let (first, goal) = (trainer.steps(), trainer.recipe().steps);
        while trainer.steps() < goal {
            let progress = trainer.run(self.evaluate).with_context(|| match kept.exists() {
                true => format!("seed {}: the last good state is in {}", self.seed, kept.display()),
                false => format!("seed {}: no checkpoint was written yet", self.seed),
            })?;
            let seconds = start.elapsed().as_secs_f64();
            let evaluated = self.ground.evaluate(trainer.actor())?;
            let made = (progress.steps - first) as f64;
            let left = seconds / made * goal.saturating_sub(progress.steps) as f64;
            let point = CurvePoint {
                steps: progress.steps,
                updates: progress.updates,
                seconds: before + seconds,
                loss: progress.loss,
                reward: progress.reward,
                episodes: progress.episodes,
                lost: progress.lost,
                ..reached(evaluated)
            };
            curve.add(point).with_context(context)?;
            println!("{:>8} {}  {:.0} min left", self.seed, point.line(), left / 60.0);
            warn(self.seed, &progress);
            if point.badness() <= best {
                best = point.badness();
                let method = Method::Td3(trainer.recipe());
                let (actor, critics) = (trainer.actor(), trainer.critics()?);
                self.save(&method, actor, critics, progress.steps, evaluated)?;
            }
            if trainer.at_checkpoint() {
                trainer.standing().save(&kept)?;
            }
            if self.stop.is_set() && trainer.steps() < goal {
                return Ok(false);
            }
        }
        println!("{:>8} policy in {}", self.seed, self.folder.display());
        Ok(true)
    }

    /// Writes the policy as it is now, the best so far.
    fn save(
        &self,
        method: &Method,
        actor: Arc<Actor>,
        critics: Arc<[Critic; 2]>,
        steps: u64,
        evaluated: Evaluated,
    ) -> Result<()> {
        let evaluation = Some(evaluated);
        let origin = Origin { seed: self.seed, steps, evaluation, ..self.ground.origin.clone() };
        let agent = Agent { actor, critics: Some(critics), origin };
        for (name, bytes) in agent.to_files().map_err(|e| anyhow!("the policy's files: {e}"))? {
            let path = self.folder.join(name);
            write_whole(&path, &bytes)
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        let document = Document {
            schema: "greylag.policy-training/1",
            program: concat!("greylag ", env!("CARGO_PKG_VERSION")),
            command_line: files::command_line(),
            method,
            best: &agent.origin,
        };
        let json = self.folder.join("training.json");
        files::write(&json, &(serde_json::to_string_pretty(&document)? + "\n"), Overwrite::Force)
    }
}

/// Says so if many episodes end outside the envelope.
fn warn(seed: u64, progress: &PolicyProgress) {
    let part = progress.lost as f64 / progress.episodes.max(1) as f64;
    if progress.updates > 0 && part > MANY {
        eprintln!(
            "seed {seed}: {:.0} % of the episodes so far left the envelope of a state that can be \
             believed (attitude, incidence, rates, airspeed); if that goes on, the model lacks flights \
             near there: collect some and learn it again",
            100.0 * part
        );
    }
}

/// A point of the curve that says what was reached, and nothing else.
pub fn reached(e: Evaluated) -> CurvePoint {
    let Evaluated { easy_deg, hard_deg, divergence_rate, .. } = e;
    CurvePoint { easy_deg, hard_deg, divergence_rate, ..CurvePoint::default() }
}

/// Seed of the targets that a training is judged by: none of those that policies are scored on.
const OTHER: u64 = 2;

impl Ground {
    /// What `actor` reaches in what it is trained in, on a tenth of a target file: a policy that is trained
    /// in a model is chosen without a flight in any simulator.
    fn evaluate(&self, actor: Arc<Actor>) -> Result<Evaluated> {
        let mut rows = TargetFile::generate(OTHER).rows;
        rows.retain(|r| r.group != Group::HardOutside && r.number % 10 == r.number / 10 % 10);
        let make = || -> Box<dyn Controller> { Box::new(Policy::of(actor.clone())) };
        let outcomes = match &self.model {
            Some(model) => imagine(model, &make, &rows, 1)?,
            None => flown(&make, &rows)?,
        };
        let scores = Evaluation::new("policy", &self.origin.model, &rows, &outcomes);
        let mean = |group: &str| scores.score(group).map_or(f64::NAN, |s| s.mean_deg);
        Ok(Evaluated {
            targets: rows.len(),
            easy_deg: mean("easy"),
            hard_deg: mean("hard_corners"),
            divergence_rate: scores.score("all").map_or(f64::NAN, |s| s.divergence_rate),
        })
    }
}

/// What came of flights in JSBSim, where the policy was trained there.
#[cfg(feature = "sitl")]
fn flown(make: Make, rows: &[Row]) -> Result<Vec<Outcome>> {
    let plant = greylag_sitl::plant::PlantOptions::default();
    Ok(crate::sim::evaluation::evaluate(&plant, make, rows, 1, &|| ())?)
}

#[cfg(not(feature = "sitl"))]
fn flown(_: Make, _: &[Row]) -> Result<Vec<Outcome>> {
    bail!("this program was built without JSBSim")
}
