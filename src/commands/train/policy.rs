//! `greylag train policy`: trains a policy in a model or in JSBSim.
//!
//! A policy is a neural network (the actor) that maps an observation to a command. Critics are networks that estimate the
//! discounted sum of future rewards. The algorithm is TD3, or the analytic policy gradient: the gradient of the reward
//! through the model over short windows of flight.

mod ground;
mod recipe;
mod run;

pub use run::reached;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::Arc;

use anyhow::{Context, Result, bail};

use super::curves;
use crate::commands::files::shipped;
use crate::commands::interruption::{Ended, Interruption};
use crate::control::policy::{Actor, Agent, Origin};
use crate::learn::policy::learning_curve::COLUMNS;
use crate::learn::{AnalyticRecipe, ValuationRecipe};
use crate::model::GreyBox;
use crate::model::residual::fingerprint;
use crate::physics::Airframe;
use crate::sim::imagined::Imagination;
use crate::sim::targets::Stratified;
use ground::Ground;
use run::Run;

/// Name of the HTML file with the learning curves.
const REPORT: &str = "policy.html";

/// Options of `greylag train policy`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Environment of the training: model:DIR, model:FILE.toml, or jsbsim.
    #[arg(long = "env", value_name = "ENV")]
    environment: Place,
    /// Algorithm: td3, or analytic (policy gradient through the model, then critics fitted to the resulting actor).
    #[arg(long, default_value = "td3", value_parser = ["td3", "analytic"])]
    algorithm: String,
    /// Number of updates of the critics that are fitted after the analytic policy gradient.
    #[arg(long, default_value_t = ValuationRecipe::default().updates, value_parser = clap::value_parser!(u64).range(1..))]
    valuation: u64,
    /// Number of updates of the analytic policy gradient.
    #[arg(long, default_value_t = AnalyticRecipe::default().updates)]
    updates: u64,
    /// Number of steps in a window, the stretch of flight over which the analytic policy gradient is taken.
    #[arg(long, default_value_t = AnalyticRecipe::default().window as u64, value_parser = clap::value_parser!(u64).range(1..=1000))]
    window: u64,
    /// Number of aircraft that fly in parallel for one update of the analytic policy gradient.
    #[arg(long, alias = "flock", default_value_t = AnalyticRecipe::default().instances as u64, value_parser = clap::value_parser!(u64).range(1..=4096))]
    gradient_batch: u64,
    /// Initial learning rate of the analytic policy gradient.
    #[arg(long, default_value_t = AnalyticRecipe::default().rate)]
    climb: f64,
    /// Error of roll or pitch (rad) or airspeed (m/s) below which the reward of the analytic policy gradient is quadratic
    /// in the error. For larger errors it is linear.
    #[arg(long, default_value_t = AnalyticRecipe::default().rounding)]
    rounding: f64,
    /// Weight of the squared change of aileron and elevator command per step in the objective of the analytic policy gradient.
    #[arg(long, default_value_t = AnalyticRecipe::default().effort)]
    effort: f64,
    /// Number of aircraft that are simulated in parallel in the model, for TD3 and for the fit of the critics.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u64).range(1..=4096))]
    instances: u64,
    /// Number of policies to train in parallel, with consecutive seeds that start at --seed.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// Seed of the first policy.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of steps of TD3, counted over all aircraft; after the warm-up there is one update per step.
    #[arg(long, default_value_t = 700_000)]
    steps: u64,
    /// Number of steps with random actions at the start of TD3 (warm-up), without updates.
    #[arg(long, default_value_t = 10_000)]
    warmup: u64,
    /// Capacity of the replay buffer of TD3 in steps.
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    replay: u64,
    /// Folder of a policy whose actor is trained further by the analytic policy gradient; its
    /// layers replace --actor.
    #[arg(long, value_name = "DIR")]
    start: Option<PathBuf>,
    /// Numbers of units of the actor's hidden layers.
    #[arg(long, value_delimiter = ',', default_values_t = [300, 300])]
    actor: Vec<usize>,
    /// Numbers of units of a critic's hidden layers.
    #[arg(long, value_delimiter = ',', default_values_t = [200, 200, 200])]
    critic: Vec<usize>,
    /// Number of steps in a minibatch of TD3.
    #[arg(long, default_value_t = 256, value_parser = clap::value_parser!(u64).range(1..))]
    batch: u64,
    /// Rate τ of the soft update of the target networks of TD3.
    #[arg(long, default_value_t = 0.05)]
    tau: f64,
    /// Learning rate of actor and critics in TD3.
    #[arg(long, default_value_t = 3e-4)]
    rate: f64,
    /// Discount factor per step.
    #[arg(long, default_value_t = 0.99)]
    discount: f64,
    /// Standard deviation of the exploration noise of TD3, where commands range from -1 to 1.
    #[arg(long, default_value_t = 0.1)]
    exploration: f64,
    /// Standard deviation of the noise that smooths the target policy of TD3.
    #[arg(long, default_value_t = 0.2)]
    smoothing: f64,
    /// Probability (0 to 1) that a commanded attitude is drawn from the hard corners (45° to 60° of roll with 25° to 30° of
    /// pitch) instead of the whole range; 0 in the paper (T. Guerin et al., 2026).
    #[arg(long, default_value_t = 0.0)]
    corners: f64,
    /// Number of models in which the analytic policy gradient flies (domain randomisation). Their coefficients are drawn from
    /// the prior distributions that the --env model states. With 0 it flies in the --env model itself. The critics are always
    /// fitted to flights in the --env model.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=4096))]
    draws: u64,
    /// Number of steps of TD3 between two evaluations, which fly in the environment of the training.
    #[arg(long, default_value_t = 10_000, value_parser = clap::value_parser!(u64).range(1..))]
    evaluate: u64,
    /// Number of steps between two checkpoints of TD3.
    #[arg(long, default_value_t = 50_000, value_parser = clap::value_parser!(u64).range(1..))]
    checkpoint: u64,
    /// Folder for the policy, its learning curve and the checkpoint (with several seeds, its
    /// subfolders seed-N); TD3 resumes from a checkpoint found there.
    #[arg(long)]
    out: PathBuf,
}

/// Environment in which a policy is trained: a model file or its folder, or JSBSim.
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

/// Trains the policies, prints their learning curves and writes one policy per seed. With TD3 it is the best policy of the
/// evaluations, with the analytic gradient the last one.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    Ok(learn(arguments, &Interruption::watch()?)?.into())
}

/// Trains like [`run`] until `stop` is set.
pub fn learn(arguments: &Arguments, stop: &Interruption) -> Result<Ended> {
    let ground = arguments.ground()?;
    if arguments.draws > 0 && !arguments.is_analytic() {
        bail!("--draws spreads the aircraft of --algorithm analytic over models; TD3 flies one");
    }
    if arguments.start.is_some() && !arguments.is_analytic() {
        bail!("--start trains an actor further by --algorithm analytic; TD3 begins with its own");
    }
    let end = arguments.seed.checked_add(arguments.seeds);
    let end =
        end.with_context(|| format!("--seed {} leaves no room for --seeds", arguments.seed))?;
    let seeds = arguments.seed..end;
    println!("{:>8} {COLUMNS}", "seed");
    let one = |seed: u64| arguments.train(&ground, seed, stop);
    // the pool has as many threads as rayon's global pool; a job scheduler can limit that number by RAYON_NUM_THREADS
    let pool = rayon::ThreadPoolBuilder::new().num_threads(rayon::current_num_threads()).build()?;
    use rayon::prelude::*;
    let seeds: Vec<u64> = seeds.collect();
    let ended = pool.install(|| seeds.into_par_iter().map(one).collect::<Result<Vec<bool>>>());
    let page = arguments.out.join(REPORT);
    match curves::draw(&arguments.out, &page) {
        Ok(()) => println!("report in {}", page.display()),
        Err(error) if ended.is_ok() => eprintln!("no learning curves were drawn: {error:#}"),
        // the training has failed as well, and its error is returned below
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
    /// What the same command does after an interruption, for a message to the user.
    fn next_time(&self) -> &'static str {
        match self.is_analytic() {
            true => "begins this policy anew",
            false => "goes on from the last checkpoint",
        }
    }

    fn is_analytic(&self) -> bool {
        self.algorithm == "analytic"
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
            if cfg!(not(feature = "demo")) {
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

    /// The actor of the policy in `--start`, from which the training starts; `None` without this option.
    fn started(&self, airframe: &Airframe) -> Result<Option<Arc<Actor>>> {
        let load = |folder: &PathBuf| -> Result<Arc<Actor>> {
            let agent = Agent::load(folder, airframe).with_context(|| {
                format!("cannot continue from the policy in {}", folder.display())
            })?;
            Ok(agent.actor)
        };
        self.start.as_ref().map(load).transpose()
    }

    /// Trains the policy of one seed. Returns `false` if interrupted.
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
            #[cfg(feature = "demo")]
            None => {
                let plant = greylag_sitl::plant::PlantOptions::default();
                let airframe = &ground.airframe;
                run.train(recipe, crate::sim::flown::Flown::new(&plant, airframe, targets)?)
            }
            #[cfg(not(feature = "demo"))]
            None => Err(anyhow::anyhow!("this program was built without JSBSim")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::{Command, command_of};

    #[test]
    fn seeds_beyond_the_largest_number_are_refused() {
        let words = ["train", "policy", "--env", "model:params/x8/learned", "--out", "unused"];
        let more = ["--seed", "18446744073709551615", "--seeds", "2"];
        let line: Vec<_> = words.iter().chain(&more).map(std::ffi::OsString::from).collect();
        let Ok(Command::Train(train)) = command_of(&line) else { panic!("no training") };
        let error = crate::commands::train::learn(&train, &Interruption::default()).unwrap_err();
        assert!(error.to_string().contains("--seed"), "{error}");
    }
}
