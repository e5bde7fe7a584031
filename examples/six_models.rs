//! Trains the six dynamics models of the paper and several variants on the same data, and compares them.
//!
//! The six models have the true, mild and severe prior, each frozen or trainable (section V-A of \[GSFM26\]). By default a
//! trainable prior is first estimated by equation error and then held, and the rollouts are weighted. The variants use the
//! losses of PhIHP and APHYNITY, train the given prior together with the residual, weight all rollouts equally as in the
//! paper, or train a residual without a prior.
//!
//! All models are trained on the same flights: a round of random actions, then rounds flown by a planner with the severe
//! trainable model. This model is retrained on all flights before each of these rounds.
//!
//! ```text
//! cargo run --release --ignore-rust-version --example six_models -- --out target/six-models
//! ```

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Parser;
use comfy_table::Table;
use rayon::prelude::*;
use serde::Serialize;

use greylag::control::lqi::Lqi;
use greylag::control::{self, Controller, ControllerKind, Target};
use greylag::learn::dynamics::export;
use greylag::learn::dynamics::residual_map::residual_map;
use greylag::learn::dynamics::score::{Horizon, free_run};
use greylag::learn::dynamics::windows::Track;
use greylag::learn::{Criterion, JXZ, Joint, Learned, Recipe, Start, Trainer};
use greylag::logs::{Flight, Sample};
use greylag::model::{GreyBox, Integrator};
use greylag::physics::State;
use greylag::sim::collect::{Place, explore, sample};
use greylag::sim::evaluation::{Evaluation, evaluate};
use greylag::sim::{Episode, Group, Simulator, TargetFile};
use greylag_sitl::plant::PlantOptions;

/// Trains the six models and their variants, scores them, and prints a table.
#[derive(Parser)]
struct Arguments {
    /// Folder for the models and the results as JSON.
    #[arg(long)]
    out: PathBuf,
    /// Number of episodes with random actions; 175 in the paper.
    #[arg(long, default_value_t = 175)]
    episodes: u32,
    /// Number of rounds of 25 episodes flown by a planner; five in the paper.
    #[arg(long, default_value_t = 5)]
    rounds: u32,
    /// Number of parameter updates of each training.
    #[arg(long, default_value_t = 20_000)]
    updates: u64,
    /// Number of units in each hidden layer of the residual.
    #[arg(long, value_delimiter = ',', default_values_t = [64, 64])]
    hidden: Vec<usize>,
    /// Names of the models to train, as in the table; all models without this option.
    #[arg(long, num_args = 1.., value_name = "NAME")]
    models: Vec<String>,
    /// Number of held-out flights of each kind.
    #[arg(long, default_value_t = 24)]
    held_out: usize,
    /// Seed of all random draws.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl Arguments {
    fn wants(&self, way: &Way) -> bool {
        self.models.is_empty() || self.models.iter().any(|name| name == way.name)
    }

    /// Checks that the selected models exist.
    fn check(&self) -> Result<()> {
        let unknown = self.models.iter().find(|name| WAYS.iter().all(|way| way.name != **name));
        let names: Vec<&str> = WAYS.iter().map(|way| way.name).collect();
        match unknown {
            Some(name) => {
                anyhow::bail!("there is no model {name:?}; there are {}", names.join(", "))
            }
            None => Ok(()),
        }
    }
}

/// Numbers of steps of the open-loop simulations.
const HORIZONS: [usize; 4] = [1, 10, 100, 500];

/// Offset of the seeds of the held-out flights.
const HELD_OUT: u64 = 9000;

/// A method of training a model.
struct Way {
    name: &'static str,
    prior: &'static str,
    trainable: bool,
    criterion: Criterion,
    /// Starting values of the trained coefficients.
    start: Start,
    /// Method of training the coefficients together with the residual, if they start from the values of the prior.
    joint: Joint,
    /// Whether only the residual is trained, with a prior whose coefficients are zero.
    alone: bool,
    /// Whether all rollouts have equal weight, as in the papers.
    alike: bool,
}

const fn way(name: &'static str, prior: &'static str, trainable: bool) -> Way {
    Way {
        name,
        prior,
        trainable,
        criterion: Criterion::Scaled,
        start: Start::EquationError,
        joint: Joint::Gradient,
        alone: false,
        alike: false,
    }
}

/// A method that trains the severe prior together with the residual, from the given values of the prior.
const fn along(name: &'static str, joint: Joint, alike: bool) -> Way {
    Way { start: Start::AsGiven, joint, alike, ..way(name, "prior-severe", true) }
}

const WAYS: [Way; 16] = [
    way("true-frozen", "prior", false),
    way("true-trainable", "prior", true),
    way("mild-frozen", "prior-mild", false),
    way("mild-trainable", "prior-mild", true),
    way("severe-frozen", "prior-severe", false),
    way("severe-trainable", "prior-severe", true),
    way("as-printed-trainable", "prior-as-printed", true),
    along("severe-joint", Joint::Gradient, false),
    along("severe-projected", Joint::Projection, false),
    along("severe-least-squares", Joint::LeastSquares, false),
    Way { alike: true, ..way("true-paper", "prior", false) },
    along("severe-paper", Joint::Gradient, true),
    along("severe-paper-projected", Joint::Projection, true),
    Way { alike: true, criterion: Criterion::Plain, ..way("severe-phihp", "prior-severe", false) },
    Way {
        alike: true,
        criterion: Criterion::Plain,
        start: Start::AsGiven,
        ..way("severe-aphynity", "prior-severe", true)
    },
    Way { alone: true, ..way("residual-alone", "prior", false) },
];

/// A row of the table.
#[derive(Serialize)]
struct Row {
    model: &'static str,
    /// Ratio ‖F_a‖/‖F_p‖ of the residual's contribution to the prior's, over the held-out flights.
    ratio: f64,
    /// Median relative error of the trained coefficients before and after training.
    coefficients: Option<[f64; 2]>,
    learned: Vec<Learned>,
    /// Errors of open-loop simulations with the prior on easy flights, hard flights and flights with random actions.
    /// `model_runs` has those with the model.
    prior: [Vec<Horizon>; 3],
    model_runs: [Vec<Horizon>; 3],
    /// Settled error (easy targets and hard corners, degrees) and divergence rate of an LQI designed from the model.
    lqi: Option<[f64; 3]>,
    training_s: f64,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    arguments.check()?;
    let params = Path::new(env!("CARGO_MANIFEST_DIR")).join("params");
    let load = |name: &str| -> Result<(PathBuf, GreyBox)> {
        let path = params.join(format!("x8/{name}.toml"));
        let mut model = GreyBox::load(&path)?;
        // the integration scheme is that of the simulator in which the flights are flown
        model.integrator = Integrator::Jsbsim;
        Ok((path, model))
    };
    std::fs::create_dir_all(&arguments.out)?;
    let (_, reference) = load("jsbsim")?;
    let held_out = held_out(&arguments, &reference)?;
    let start = Instant::now();
    let flights = explored(&arguments, &load("prior-severe")?.1)?;
    let transitions: usize = flights.iter().map(|f| f.samples.len() - 1).sum();
    println!(
        "{transitions} transitions of {} flights in {} rounds, trained after each, in {:.0} s",
        flights.len(),
        arguments.rounds + 1,
        start.elapsed().as_secs_f64()
    );
    let (_, truth) = load("prior")?;
    let mut rows = Vec::new();
    for way in WAYS.iter().filter(|way| arguments.wants(way)) {
        let (path, prior) = load(way.prior)?;
        let start = Instant::now();
        let trainer = trained(&arguments, way, &prior, &flights)?;
        let training_s = start.elapsed().as_secs_f64();
        let model = trainer.model()?;
        let folder = arguments.out.join(way.name);
        std::fs::create_dir_all(&folder)?;
        if !way.alone {
            let names: Vec<String> =
                trainer.coefficients(None).into_iter().map(|c| c.name).collect();
            let origin = export::origin(&model, trainer.data(), arguments.seed);
            let about =
                format!("Learned from {transitions} transitions of flight, prior {}.", way.prior);
            let said = export::Text { about: &about, trained: &names };
            export::save(&model, &path, said, &origin, &folder)?;
        }
        let lqi = steered(&model, &params.join("targets.csv"))?;
        let score = |model: &GreyBox| {
            [0, 1, 2].map(|g| free_run(model, &tracks(model, &held_out[g]), &HORIZONS))
        };
        let learned = trainer.coefficients(Some(&truth));
        let everything = held_out.concat();
        rows.push(Row {
            model: way.name,
            ratio: residual_map(&model, &tracks(&model, &everything)).map_or(0.0, |p| p.ratio),
            coefficients: errors(&learned),
            learned,
            prior: score(&prior),
            model_runs: score(&model),
            lqi,
            training_s,
        });
        println!("{}", table(&rows));
    }
    beside(&rows);
    for row in &rows {
        for Learned { name, start, value, truth } in &row.learned {
            let truth = truth.unwrap_or(f64::NAN);
            println!("{:22} {name:28} {start:9.5} -> {value:9.5}, true {truth:9.5}", row.model);
        }
    }
    let json = arguments.out.join("six-models.json");
    std::fs::write(&json, serde_json::to_string_pretty(&rows)? + "\n")
        .with_context(|| format!("cannot write {}", json.display()))
}

/// Prints the error of each model after 100 steps as a multiple of the first model's error.
fn beside(rows: &[Row]) {
    let off = |row: &Row| row.model_runs.each_ref().map(|runs| runs[2].rms);
    let Some(first) = rows.first() else { return };
    for row in rows {
        let [easy, hard, random]: [f64; 3] = std::array::from_fn(|g| off(row)[g] / off(first)[g]);
        println!(
            "{:22} after {} steps {easy:.2} easy, {hard:.2} hard, {random:.2} random times the error of {}",
            row.model, HORIZONS[2], first.model
        );
    }
}

/// Held-out flights: to new easy targets and to new hard targets, both flown by an LQI designed from `reference`, and the same
/// number of flights with random actions, which include stalls.
fn held_out(arguments: &Arguments, reference: &GreyBox) -> Result<[Vec<Flight>; 3]> {
    let targets = TargetFile::generate(HELD_OUT + arguments.seed);
    let mut controller = Lqi::new(reference)?;
    let mut simulator = Simulator::new(&PlantOptions::default())?;
    let mut fly = |group: Group| -> Result<Vec<Flight>> {
        let rows = targets.rows.iter().filter(|r| r.group == group).take(arguments.held_out);
        rows.map(|row| {
            let target = Target {
                roll: row.roll_deg.to_radians(),
                pitch: row.pitch_deg.to_radians(),
                airspeed: State::NEUTRAL.airspeed,
            };
            let mut samples: Vec<Sample> = Vec::new();
            let (environment, controller) =
                (&mut simulator, &mut controller as &mut dyn Controller);
            Episode { environment, controller, seed: 1 }
                .fly(&target, |seen, command| samples.push(sample(seen, Some(command), &target)))?;
            Ok(Flight::from(samples))
        })
        .collect()
    };
    let (easy, hard) = (fly(Group::Easy)?, fly(Group::HardCorners)?);
    let places = (0..arguments.held_out as u32).map(|episode| Place {
        seed: HELD_OUT + arguments.seed,
        round: 0,
        episode,
    });
    let stalled: Result<Vec<Flight>, _> =
        places.map(|place| explore(&mut simulator, None, &place)).collect();
    Ok([easy, hard, stalled?])
}

/// Flights for training: a round of random actions, then rounds flown by a planner. Its model is trained on all earlier
/// rounds.
fn explored(arguments: &Arguments, prior: &GreyBox) -> Result<Vec<Flight>> {
    let mut flights = round(arguments, 0, arguments.episodes, None)?;
    for k in 1..=arguments.rounds {
        let trainer = trained(arguments, &way("explorer", "prior-severe", true), prior, &flights)?;
        let planner = control::build(ControllerKind::Cem, &trainer.model()?)?;
        flights.extend(round(arguments, k, 25, Some(planner.as_ref()))?);
        eprintln!("round {k}: {} flights", flights.len());
    }
    Ok(flights)
}

fn round(
    arguments: &Arguments,
    round: u32,
    episodes: u32,
    planner: Option<&dyn Controller>,
) -> Result<Vec<Flight>> {
    let start = || {
        let planner = planner.map(|p| p.boxed_clone());
        Simulator::new(&PlantOptions::default()).map(|simulator| (simulator, planner))
    };
    (0..episodes)
        .into_par_iter()
        .map_init(start, |worker, episode| {
            let (simulator, planner) = worker.as_mut().map_err(|e| anyhow::anyhow!("{e}"))?;
            let place = Place { seed: arguments.seed, round, episode };
            let planner = planner.as_mut().map(|p| p.as_mut() as &mut dyn Controller);
            Ok(explore(simulator, planner, &place)?)
        })
        .collect()
}

fn tracks(model: &GreyBox, flights: &[Flight]) -> Vec<Track> {
    flights.iter().map(|flight| Track::of(model, flight)).collect()
}

fn trained(
    arguments: &Arguments,
    way: &Way,
    prior: &GreyBox,
    flights: &[Flight],
) -> Result<Trainer> {
    let mut prior = prior.clone();
    if way.alone {
        let none = vec![0.0; prior.coefficients().len()];
        prior.set_coefficients(&none);
    }
    let trainable = if way.trainable { perturbed(way, &prior)? } else { Vec::new() };
    let recipe = Recipe {
        updates: arguments.updates,
        hidden: arguments.hidden.clone(),
        floor: if way.alike { None } else { Recipe::default().floor },
        trainable,
        criterion: way.criterion,
        start: way.start,
        joint: way.joint,
        prior_rate: match (way.start, way.joint) {
            (Start::AsGiven, Joint::Gradient) => 3e-3,
            _ => 0.0,
        },
        seed: arguments.seed,
        ..Recipe::default()
    };
    let tracks = tracks(&prior, flights);
    let mut trainer = Trainer::new(recipe, &prior, tracks)?;
    while !trainer.is_done() {
        let p = trainer.run(arguments.updates.div_ceil(10))?;
        let ratio = p.loss.learned / p.loss.prior;
        eprintln!("{} {} L/L_prior {:.2e} |Fa|/|Fp| {ratio:.3}", way.name, p.update, p.normalised);
    }
    Ok(trainer)
}

/// Names of the coefficients that are trained: those with errors in the severe prior, or Jxz and the thrust for the prior as
/// printed in the paper.
fn perturbed(way: &Way, prior: &GreyBox) -> Result<Vec<String>> {
    if way.prior == "prior-as-printed" {
        return Ok(vec![JXZ.into(), "thrust_linear.Cp_n".into()]);
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    let [severe, truth] = [
        GreyBox::load(&folder.join("prior-severe.toml"))?,
        GreyBox::load(&folder.join("prior.toml"))?,
    ];
    let pairs = severe.coefficients().iter().zip(truth.coefficients());
    let names = pairs.filter(|(s, t)| s.value != t.value).map(|(s, _)| s.name.clone());
    let known = |name: &String| prior.coefficients().iter().any(|c| c.name == *name);
    Ok(names.filter(known).collect())
}

fn errors(learned: &[Learned]) -> Option<[f64; 2]> {
    let median = |get: &dyn Fn(&Learned) -> f64| {
        let off = |l: &Learned| Some((get(l) / l.truth? - 1.0).abs());
        let mut all: Vec<f64> = learned.iter().filter_map(off).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    };
    Some([median(&|l| l.start)?, median(&|l| l.value)?])
}

/// Mean settled errors (degrees) of an LQI designed from `model` on easy targets and hard corners, and its divergence rate.
/// `None` if no LQI can be designed.
fn steered(model: &GreyBox, targets: &Path) -> Result<Option<[f64; 3]>> {
    let Ok(lqi) = Lqi::new(model) else { return Ok(None) };
    let mut targets = TargetFile::load(targets)?;
    targets.rows.retain(|r| r.group != Group::HardOutside);
    let plant = PlantOptions::default();
    let outcomes = evaluate(&plant, &|| lqi.boxed_clone(), &targets.rows, 1, &|| ())?;
    let scores = Evaluation::new("lqi", &model.name, &targets.rows, &outcomes);
    let mean = |name: &str| scores.score(name).map_or(f64::NAN, |s| s.mean_deg);
    let lost = scores.score("all").map_or(f64::NAN, |s| s.divergence_rate);
    Ok(Some([mean(Group::Easy.name()), mean(Group::HardCorners.name()), lost]))
}

fn table(rows: &[Row]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header([
        "model",
        "|Fa|/|Fp|",
        "coef. error",
        "1 easy",
        "10",
        "100",
        "500",
        "1 hard",
        "10",
        "100",
        "500",
        "1 random",
        "10",
        "100",
        "500",
        "LQI easy",
        "hard",
        "lost",
        "s",
    ]);
    for row in rows {
        let mut cells = vec![row.model.to_owned(), format!("{:.3}", row.ratio)];
        cells.push(row.coefficients.map_or("-".into(), |[before, after]| {
            format!("{:.0} -> {:.1} %", 100.0 * before, 100.0 * after)
        }));
        for (prior, model) in row.prior.iter().zip(&row.model_runs) {
            // ratio of the model's rms error to that of the prior without a residual
            cells.extend(prior.iter().zip(model).map(|(p, m)| format!("{:.4}", m.rms / p.rms)));
        }
        match row.lqi {
            Some([easy, hard, lost]) => cells.extend([
                format!("{easy:.3}"),
                format!("{hard:.3}"),
                format!("{:.1} %", 100.0 * lost),
            ]),
            None => cells.extend(["none".into(), "none".into(), "-".into()]),
        }
        cells.push(format!("{:.0}", row.training_s));
        table.add_row(cells);
    }
    table
}
