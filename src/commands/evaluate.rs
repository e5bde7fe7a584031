//! `greylag evaluate`: flies controllers to targets (commanded attitude and airspeed) and scores them.

mod any;
mod derivatives;
mod draws;
mod next;
mod tables;
mod targets;

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::ValueEnum;
use greylag_sitl::plant::PlantOptions;
use greylag_sitl::plant_arguments::PlantArgs;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::commands::files::{self, shipped};
use crate::commands::start::{self, StartArguments};
use crate::commands::terminal::print_next;
use crate::commands::{bar, choices, controllers, fly, given, outputs};
use crate::control::cem::Change;
use crate::control::envelope::Guarded;
use crate::control::policy::Agent;
use crate::control::quality::Limits;
use crate::control::{Controller, ControllerKind, Needs, Source, Target, build};
use crate::model::GreyBox;
use crate::report::EvaluationReport;
use crate::sim::episode::STEPS;
use crate::sim::evaluation::{Course, Evaluation, evaluate_courses};
use crate::sim::tracking::{Tracking, track};
use crate::sim::{Group, Simulator};
use draws::over_draws;

/// Options that apply to flights in JSBSim only. They conflict with `--draws` and `--any`, which draw the aircraft at random.
const IN_JSBSIM: [&str; 11] = [
    "report",
    "aircraft",
    "aircraft_dir",
    "property",
    "set",
    "hide",
    "wind_ned_mps",
    "turbulence_severity",
    "gust",
    "start_airspeed_mps",
    "start_altitude_m",
];

/// Options that conflict with `--any`. Its aircraft fly random attitudes in place of targets. Its controllers are designed
/// for each aircraft and have no envelope limiter.
const UNUSED_BY_ANY: [&str; 11] = [
    "draws",
    "steps",
    "no_targets",
    "targets",
    "groups",
    "every",
    "beyond_envelope",
    "models",
    "policies",
    "changes",
    "envelope",
];

/// Options of `greylag evaluate`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Controllers to be evaluated.
    #[arg(long = "controller", value_name = "NAME", num_args = 1.., required = true, value_parser = choices::controller())]
    controllers: Vec<ControllerKind>,
    /// Models that the controllers are designed from or plan with.
    #[arg(long = "model", num_args = 1.., default_values_os_t = [PathBuf::from(fly::MODEL)])]
    models: Vec<PathBuf>,
    /// Folders of trained policies, for controllers that need one.
    #[arg(long = "policy", value_name = "DIR", num_args = 1.., default_values_os_t = [PathBuf::from(controllers::POLICY)])]
    policies: Vec<PathBuf>,
    /// Settings of the planners that differ from the defaults, as KEY=VALUE.
    #[arg(long = "planner", value_name = "KEY=VALUE", num_args = 1..)]
    changes: Vec<Change>,
    /// File of the targets to fly.
    #[arg(long, default_value = "params/targets.csv")]
    targets: PathBuf,
    /// Fly only these groups of targets.
    #[arg(long = "group", num_args = 1.., value_parser = choices::group())]
    groups: Vec<Group>,
    /// Fly only one target in N.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    every: u32,
    /// Also fly this number of steps between random attitudes of the envelope: the first attitude
    /// is held for 5 s at the cruise airspeed, then the second is flown for 8 s and scored. The
    /// same --seed draws the same steps.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=10_000))]
    steps: u32,
    /// Fly only the steps, and no targets.
    #[arg(long, requires = "steps", conflicts_with_all = ["targets", "groups", "every"])]
    no_targets: bool,
    /// Fly targets beyond the bank and pitch of the airframe's envelope too.
    #[arg(long)]
    beyond_envelope: bool,
    /// In place of JSBSim, fly this number of models whose coefficients are drawn from the prior
    /// distributions of the first --model: Monte Carlo over the uncertainty of the aircraft. The
    /// controllers keep the --model that they are built from.
    #[arg(long, value_name = "N", conflicts_with_all = IN_JSBSIM, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    draws: Option<u32>,
    /// In place of JSBSim, fly this number of aircraft drawn from a distribution, a minute of random attitudes each. A controller
    /// that needs a model is designed from the aircraft's exact model and from its textbook model.
    #[arg(long, value_name = "N", conflicts_with_all = IN_JSBSIM, conflicts_with_all = UNUSED_BY_ANY, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    any: Option<u32>,
    /// The distribution of --any, and further models whose aircraft fly the same minute.
    #[command(flatten)]
    of_any: any::AnyArguments,
    /// Whether the controllers fly behind the envelope limiter (load factor, angle of attack, bank, sideslip), as in `fly` and
    /// `demo`, or bare, as in the paper.
    #[arg(long, value_name = "WHAT", default_value = "free", value_enum)]
    envelope: EnvelopeName,
    /// Seed of the random numbers of controllers, air and draws.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    #[command(flatten)]
    plant: PlantArgs,
    #[command(flatten)]
    start: StartArguments,
    /// Write the scores as JSON; `-` for standard output, with nothing else on it.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write the transients, the scores beside the paper's, single flights and the planners'
    /// rollouts as an HTML page.
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    /// Replace the JSON file and the page if they exist.
    #[arg(long)]
    force: bool,
}

impl Arguments {
    /// Whether the controllers fly with the envelope limiter.
    fn limited(&self) -> bool {
        self.envelope == EnvelopeName::Kept
    }
}

/// Protection between a controller and the surfaces: the envelope limiter, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum EnvelopeName {
    Kept,
    Free,
}

/// Contents of the JSON file.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    program: &'static str,
    command_line: String,
    seed: u32,
    targets: String,
    aircraft: &'a str,
    controllers: &'a [Evaluation],
}

/// Flies and scores the controllers, prints the tables, and writes JSON and page.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let overwrite = arguments.force.into();
    outputs::check(arguments.json.iter().chain(&arguments.report), inputs(arguments), overwrite)?;
    controllers::check_changes(&arguments.controllers, &arguments.changes)?;
    if let Some(count) = arguments.any {
        return any::fly(arguments, count);
    }
    let rows = targets::rows(arguments)?;
    let mut plant = arguments.plant.options(arguments.seed);
    // all errors of the options are reported before the first flight
    let load = |path: &PathBuf| GreyBox::load(&shipped(path));
    let models = arguments.models.iter().map(load).collect::<Result<Vec<_>, _>>()?;
    let rows = targets::within_envelope(rows, arguments, &models[0].airframe)?;
    if let Some(draws) = arguments.draws {
        return over_draws(arguments, draws, &models, &rows);
    }
    start::describe(&mut plant, &models)?;
    plant.start = arguments.start.start(&plant.aircraft, &models)?;
    let entrants = entrants(arguments, &models)?;
    start::introduce(&plant, &models)
        .with_context(|| format!("cannot fly aircraft {}", plant.aircraft))?;
    let airframe = &models[0].airframe;
    let courses = targets::courses(arguments, &rows, plant.start.airspeed_mps, airframe);
    let limits = Limits::of(airframe);
    let evaluations = entrants
        .iter()
        .map(|e| one(arguments.seed, e, &courses, &limits, &plant))
        .collect::<Result<Vec<_>>>()?;
    let then = next::next(arguments, &evaluations, &plant);
    if !files::is_stdout(arguments.json.as_deref()) {
        tables::print(&evaluations, arguments.limited());
        print_next(&then);
    }
    if let Some(path) = &arguments.json {
        let document = Document {
            schema: "greylag.evaluation/1",
            program: concat!("greylag ", env!("CARGO_PKG_VERSION")),
            command_line: files::command_line(),
            seed: arguments.seed,
            targets: arguments.targets.display().to_string(),
            aircraft: &plant.aircraft,
            controllers: &evaluations,
        };
        files::write(path, &(serde_json::to_string_pretty(&document)? + "\n"), overwrite)?;
    }
    if let Some(path) = &arguments.report {
        let flights = flights(&entrants, &plant)?;
        files::write(path, &page(arguments, &evaluations, &flights, then), overwrite)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The files that the command reads.
fn inputs(arguments: &Arguments) -> Vec<PathBuf> {
    let Arguments { models, policies, targets, of_any, .. } = arguments;
    let models = models.iter().chain(&of_any.beside).flat_map(|path| given::files(path));
    let policies = policies.iter().flat_map(|folder| Agent::files(&shipped(folder)));
    let named = [targets, &of_any.population].map(|path| shipped(path));
    let plant = arguments.plant.options(arguments.seed);
    let name = &plant.aircraft;
    let aircraft = plant.aircraft_dir.map(|folder| folder.join(name).join(format!("{name}.xml")));
    models.chain(policies).chain(named).chain(aircraft).collect()
}

/// Commanded roll and pitch, degrees, in Figures 7 to 9 of the paper \[GSFM26\] (see `src/lib.rs`).
const SHOWN: [[f64; 2]; 3] = [[-58.0, -21.0], [55.0, 28.0], [20.0, 10.0]];

/// Flies every controller to each of the attitudes [`SHOWN`]. Returns each target with the flight of each controller.
fn flights(entrants: &[Entrant], plant: &PlantOptions) -> Result<Vec<(Target, Vec<Tracking>)>> {
    let mut simulator = Simulator::new(plant)?;
    let mut all = Vec::new();
    for [roll, pitch] in SHOWN.map(|angles| angles.map(f64::to_radians)) {
        let target = Target { roll, pitch, airspeed: plant.start.airspeed_mps };
        let flown = entrants.iter().map(|e| {
            let mut controller = e.controller.boxed_clone();
            track(&mut simulator, controller.as_mut(), &target, STEPS)
        });
        all.push((target, flown.collect::<Result<Vec<_>, _>>()?));
    }
    Ok(all)
}

fn page(
    arguments: &Arguments,
    evaluations: &[Evaluation],
    flights: &[(Target, Vec<Tracking>)],
    next: String,
) -> String {
    let provenance = [
        ("targets", arguments.targets.display().to_string()),
        ("seed", arguments.seed.to_string()),
        ("planner", format!("{:?}", arguments.changes)),
        ("command", files::command_line()),
        ("program", concat!("greylag ", env!("CARGO_PKG_VERSION")).into()),
    ];
    let report = EvaluationReport {
        subtitle: subtitle(arguments),
        evaluations,
        flights,
        limited: arguments.limited(),
        next,
        provenance: provenance.map(|(k, v)| (k.into(), v)).to_vec(),
    };
    report.page().render()
}

/// Description of the evaluation in one line.
fn subtitle(arguments: &Arguments) -> String {
    let groups: Vec<&str> = arguments.groups.iter().map(|group| group.name()).collect();
    let groups = match groups.is_empty() {
        true => String::new(),
        false => format!(" ({})", groups.join(", ").replace('_', " ")),
    };
    let path = arguments.targets.display();
    let targets = match (arguments.no_targets, arguments.every) {
        (true, _) => Vec::new(),
        (false, 1) => vec![format!("targets of {path}{groups}")],
        (false, n) => vec![format!("targets of {path}{groups}, one in {n}")],
    };
    let steps =
        (arguments.steps > 0).then(|| format!("{} steps between attitudes", arguments.steps));
    let flown: Vec<String> = targets.into_iter().chain(steps).collect();
    format!("Flown in JSBSim: {}", flown.join("; "))
}

/// A controller ready to fly, with the name of its model and the folder of its policy.
struct Entrant {
    kind: ControllerKind,
    model: String,
    controller: Box<dyn Controller>,
}

/// Builds each controller once for every model, every policy, or every pair of both, as its kind needs. A controller that
/// needs neither is built once.
fn entrants(arguments: &Arguments, models: &[GreyBox]) -> Result<Vec<Entrant>> {
    let (models, none) = (models.iter(), PathBuf::new());
    let policies = || arguments.policies.iter();
    let mut entrants = Vec::new();
    for kind in &arguments.controllers {
        let sources: Vec<(&GreyBox, String, &PathBuf)> = match kind.needs() {
            Needs::Model => models.clone().map(|m| (m, m.name.clone(), &none)).collect(),
            Needs::Gains => models.clone().take(1).map(|m| (m, "-".into(), &none)).collect(),
            Needs::Both | Needs::ModelAndAnyPolicy => models
                .clone()
                .flat_map(|m| policies().map(move |p| (m, m.name.clone(), p)))
                .collect(),
            Needs::Policy => models
                .clone()
                .take(1)
                .flat_map(|m| policies().map(move |p| (m, String::new(), p)))
                .collect(),
        };
        for (model, mut name, folder) in sources {
            let agent = controllers::policy(*kind, model, folder)?;
            let changes = &arguments.changes;
            let mut controller = build(*kind, Source { model, agent: agent.as_ref(), changes })?;
            if arguments.limited() {
                controller = Box::new(Guarded::new(controller, model));
            }
            if agent.is_some() {
                let separator = if name.is_empty() { "" } else { ", " };
                name += &format!("{separator}{}", folder.display());
            }
            entrants.push(Entrant { kind: *kind, model: name, controller });
        }
    }
    Ok(entrants)
}

fn one(
    seed: u32,
    entrant: &Entrant,
    courses: &[Course],
    limits: &Limits,
    plant: &PlantOptions,
) -> Result<Evaluation> {
    let Entrant { kind, model, controller } = entrant;
    let what = format!("{kind}, model {model}");
    let progress = progress(courses.len() as u64, "targets", &what);
    let make = || controller.boxed_clone();
    let outcomes = evaluate_courses(plant, &make, courses, seed, &|| progress.inc(1))
        .with_context(|| format!("cannot fly aircraft {}", plant.aircraft))?;
    progress.finish_and_clear();
    Ok(Evaluation::measured([kind.name(), model], courses, &outcomes, limits))
}

/// A progress bar on a terminal. Elsewhere one plain line is printed.
fn progress(length: u64, of: &str, what: &str) -> ProgressBar {
    if bar::is_silent() {
        return ProgressBar::hidden();
    }
    if !std::io::stderr().is_terminal() {
        eprintln!("flying {length} {of} with {what}");
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length).with_message(what.to_owned());
    match ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta} left") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}
