//! `greylag faults`: simulates flights of the companion (Greylag's autopilot) with faults, which the seed of a flight determines.
//! A finding is a violation of a flight rule. The counterpart is the flight controller or simulator on the companion's link.

mod ledger;
mod monitor;
mod search;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use greylag_sitl::plant::PlantOptions;
use rayon::prelude::*;
use serde::Serialize;

use crate::commands::controllers::POLICY;
use crate::commands::files::{JsonArgument, Overwrite};
use crate::commands::fly::{self, companion_with};
use crate::commands::{choices, start};
use crate::control::ControllerKind;
use crate::model::GreyBox;
use crate::sim::faults::{Case, Cause, CompanionFactory, Counterpart, FaultKind, Report};
use ledger::{Entry, Ledger};
use search::Search;

/// Name of the default aircraft.
const AIRCRAFT: &str = "x8";

/// Error message if a scenario or a monitor campaign is requested with several controllers.
const ONE_CONTROLLER: &str =
    "--scenario and --monitor fly one controller: give --controller one name";

/// The arguments of `greylag faults`.
#[derive(Args)]
pub struct Arguments {
    /// Number of flights for each controller and each counterpart.
    #[arg(long, value_name = "N", default_value_t = 100)]
    flights: u64,
    /// Seed of the first flight; the next flights have the following seeds.
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    first: u64,
    /// Controllers that fly the campaign.
    #[arg(long, value_name = "NAME", num_args = 1.., default_values = ["lqi"], value_parser = choices::controller())]
    controller: Vec<ControllerKind>,
    /// The simulator's aircraft; the simulated flight controllers have gains for the X8 only, so other aircraft need the
    /// counterpart sitl.
    #[arg(long, value_name = "NAME", default_value = AIRCRAFT, conflicts_with = "resume")]
    aircraft: String,
    /// Model that the controllers are designed from or plan with.
    /// The file of `--resume` is for the default model only.
    #[arg(
        long,
        value_name = "FILE",
        default_value = fly::MODEL,
        conflicts_with = "resume"
    )]
    model: PathBuf,
    /// Flight controller or simulator at the other end of the vehicle's link.
    #[arg(long, value_name = "NAME", num_args = 1.., default_values = ["sitl", "px4", "ardupilot"], value_parser = counterparts())]
    counterpart: Vec<Counterpart>,
    /// Show the faults and the messages of each flight with a finding.
    #[arg(long)]
    show: bool,
    /// Record each flight in this file, and skip those that it already has; another program version needs another file.
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Search with this number of flights for a violation of a flight rule by the first controller:
    /// faults, winds, targets and requests of the flights that are nearest to a violation are varied.
    /// `--first` is the seed of the search.
    #[arg(long, value_name = "N", conflicts_with_all = ["flights", "resume", "show"])]
    search: Option<u64>,
    /// Fly the scenario in this file (JSON, as `--search` prints it) and show how far each rule is from being broken.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["flights", "resume", "show", "search", "json", "counterpart"])]
    scenario: Option<PathBuf>,
    /// Measure false alarms and detection delays of the model monitor: fly this number of flights
    /// without a failure and with each failure, with a simulated ArduPlane whose attitude errors are
    /// drawn for each flight. `--first` is the first seed.
    #[arg(long, value_name = "N", conflicts_with_all = ["flights", "resume", "show", "search", "scenario", "json", "counterpart"])]
    monitor: Option<u64>,
    #[command(flatten)]
    json: JsonArgument,
}

/// Contents of the JSON file: the flights with their findings.
#[derive(Serialize)]
struct Document<'a> {
    flights: &'a [Entry],
}

/// Parser of the name of a counterpart.
fn counterparts() -> impl TypedValueParser<Value = Counterpart> {
    let names = Counterpart::ALL.map(|counterpart| {
        PossibleValue::new(counterpart.name()).help(match counterpart {
            Counterpart::Sitl => "The simulator's shim",
            Counterpart::Px4 => "PX4 by surfaces",
            Counterpart::Px4Attitude => "PX4 by attitude",
            Counterpart::Ardupilot => "ArduPilot by channels",
            Counterpart::ArdupilotAttitude => "ArduPilot by attitude",
        })
    });
    PossibleValuesParser::new(names).try_map(|name| {
        Counterpart::ALL
            .into_iter()
            .find(|counterpart| counterpart.name() == name)
            .ok_or("no such counterpart")
    })
}

/// Flies the campaign. The exit status is 0 if the companion itself never failed and a fault caused every other finding.
///
/// # Errors
/// If an aircraft or a controller cannot be built, or the file of `--resume` cannot be used.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let single = arguments.scenario.is_some() || arguments.monitor.is_some();
    ensure!(!single || arguments.controller.len() == 1, "{ONE_CONTROLLER}");
    arguments.json.writable(Overwrite::New)?;
    let quiet = arguments.json.takes_stdout();
    let model = fly::model(&arguments.model, None)?;
    let plant = plant(&arguments.aircraft, &model)?;
    let ledger = arguments.resume.as_deref().map(Ledger::open).transpose()?;
    let mut entries = Vec::new();
    for &controller in &arguments.controller {
        let factory = factory(controller, &model, &plant)?;
        if let Some(file) = &arguments.scenario {
            return search::fly(&factory, file);
        }
        if let Some(flights) = arguments.monitor {
            return monitor::run(&factory, arguments.first, flights);
        }
        if let Some(flights) = arguments.search {
            return search::run(&Search {
                factory: &factory,
                counterparts: &arguments.counterpart,
                flights,
                seed: arguments.first,
                json: &arguments.json,
            });
        }
        let before = entries.len();
        for &counterpart in &arguments.counterpart {
            let seeds = seeds(arguments.first, arguments.flights)?;
            let fly = |seed| -> Result<Entry> {
                let case = Case { seed, controller, counterpart };
                if let Some(known) = ledger.as_ref().and_then(|ledger| ledger.find(&case)) {
                    return Ok(known);
                }
                let report = factory.fly(case)?;
                if arguments.show && !quiet && !report.findings.is_empty() {
                    show(&report);
                }
                let entry = Entry::from(&report);
                if let Some(ledger) = &ledger {
                    ledger.note(&entry)?;
                }
                Ok(entry)
            };
            let flown: Result<Vec<Entry>> = seeds.into_par_iter().map(fly).collect();
            entries.extend(flown?);
        }
        if !quiet {
            print_faults(controller, &arguments.counterpart, &entries[before..]);
        }
    }
    if !quiet {
        print_findings(&entries);
    }
    let document = Document { flights: &entries };
    arguments.json.write("greylag.faults/1", &document, Overwrite::New)?;
    let failed = entries.iter().any(|entry| entry.findings.iter().any(|f| f.is_failure()));
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The seeds of `flights` flights from `first` on.
///
/// # Errors
/// If a seed would exceed 64 bits.
fn seeds(first: u64, flights: u64) -> Result<std::ops::Range<u64>> {
    let end = first.checked_add(flights);
    let end = end.with_context(|| format!("--first {first} leaves no room for {flights} seeds"))?;
    Ok(first..end)
}

/// Factory of the default companions: the controller `kind`, built from the default model, flies the X8.
///
/// # Errors
/// If the shipped model or policy cannot be read.
#[cfg(feature = "study")]
pub fn shipped(kind: ControllerKind) -> Result<CompanionFactory> {
    let model = fly::model(fly::MODEL.as_ref(), None)?;
    let plant = plant(AIRCRAFT, &model)?;
    factory(kind, &model, &plant)
}

/// The simulator's aircraft with the airframe of `model`, at its default start.
fn plant(aircraft: &str, model: &GreyBox) -> Result<PlantOptions> {
    let models = std::slice::from_ref(model);
    let mut plant = PlantOptions { aircraft: aircraft.into(), ..PlantOptions::default() };
    start::describe(&mut plant, models)?;
    plant.start = start::usual(&plant.aircraft, models)?;
    Ok(plant)
}

fn factory(
    kind: ControllerKind,
    model: &GreyBox,
    plant: &PlantOptions,
) -> Result<CompanionFactory> {
    let companion = companion_with(kind, model, POLICY.as_ref())?;
    Ok(CompanionFactory::new(companion, model)?.with_aircraft(plant.clone()))
}

/// Prints a table with one row for each kind of fault and one column for each counterpart. Each entry states the number of
/// flights with the fault, and how many of these have a finding.
fn print_faults(controller: ControllerKind, counterparts: &[Counterpart], entries: &[Entry]) {
    println!("\n{}: findings of flights of 60 s with each fault", controller.name());
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(["fault"].into_iter().chain(counterparts.iter().map(|o| o.name())));
    for kind in FaultKind::DRAWN {
        let cells = counterparts.iter().map(|counterpart| {
            let with = entries.iter().filter(|e| {
                e.counterpart == counterpart.name() && e.faults().iter().any(|f| f.kind == kind)
            });
            let (all, found) = with.fold((0, 0), |(all, found), e| {
                (all + 1, found + usize::from(!e.findings.is_empty()))
            });
            if found == 0 { format!("· of {all}") } else { format!("{found} of {all}") }
        });
        table.add_row([kind.name().to_owned()].into_iter().chain(cells));
    }
    println!("{table}");
}

/// Prints the counts of findings. For each flight with a finding that fails the campaign, prints the command that repeats
/// the flight.
fn print_findings(entries: &[Entry]) {
    println!("\n{} flights in all", entries.len());
    let mut counts: BTreeMap<(&str, &str), u64> = BTreeMap::new();
    for found in entries.iter().flat_map(|entry| &entry.findings) {
        *counts.entry((&found.finding, found.standing())).or_default() += 1;
    }
    for ((finding, standing), count) in &counts {
        println!("  {finding}, {standing}: {count}");
    }
    println!(
        "of them, panic, command, slew, hand-back or unreported: {}",
        entries.iter().flat_map(|e| &e.findings).filter(|f| f.is_own()).count()
    );
    for entry in entries.iter().filter(|entry| entry.findings.iter().any(|f| f.is_failure())) {
        println!("greylag faults {} --show", entry.options());
    }
}

/// Prints the findings, the faults and the companion's messages of a flight.
fn show(report: &Report) {
    let mut lines = vec![format!("greylag faults {}", Entry::from(report).options())];
    for f in &report.findings {
        let cause = f.cause.map_or("", Cause::name);
        lines.push(format!("    {:6.2} s: found {} {cause}", f.at_s, f.finding.name()));
    }
    for f in &report.faults {
        let (kind, s) = (f.kind.name(), f.strength);
        lines.push(format!("    {:6.2} to {:6.2} s: {kind}, strength {s:.2}", f.from_s, f.to_s));
    }
    lines.extend(report.texts.iter().map(|(at, words)| format!("    {at:6.2} s: said {words}")));
    println!("{}", lines.join("\n"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{Controller, Observation, Target};
    use crate::flight::pilot::{Config, Pilot};
    use crate::flight::runtime::Companion;
    use crate::physics::Command;
    use crate::sim::faults::Finding;

    /// Runs a test on all cores with a large stack. The design of the LQI needs it in a build without optimisation, because
    /// its dual numbers are large.
    fn roomy(test: fn()) {
        let pool = rayon::ThreadPoolBuilder::new().stack_size(16 << 20).build().unwrap();
        pool.install(test);
    }

    fn factory() -> CompanionFactory {
        let model = fly::model("params/x8/jsbsim.toml".as_ref(), None).unwrap();
        CompanionFactory::new(
            companion_with(ControllerKind::Lqi, &model, POLICY.as_ref()).unwrap(),
            &model,
        )
        .unwrap()
    }

    #[test]
    fn a_few_flights_with_every_fault_leave_the_companion_sound() {
        roomy(|| {
            let factory = factory();
            // Over these seeds each kind of fault is the first fault of exactly one flight. The seeds are distributed over the
            // counterparts.
            for seed in 0..FaultKind::DRAWN.len() as u64 {
                let counterpart = Counterpart::ALL[seed as usize % Counterpart::ALL.len()];
                let case = Case { seed, controller: ControllerKind::Lqi, counterpart };
                let report = factory.fly(case).unwrap();
                let entry = Entry::from(&report);
                assert!(
                    !entry.findings.iter().any(|f| f.is_failure()),
                    "{}: {:?} {:?}",
                    entry.options(),
                    report.findings,
                    report.texts
                );
            }
        });
    }

    #[test]
    fn the_seeds_end_at_the_largest_number() {
        assert_eq!(seeds(3, 2).unwrap(), 3..5);
        assert_eq!(seeds(u64::MAX - 1, 1).unwrap(), u64::MAX - 1..u64::MAX);
        assert!(seeds(u64::MAX, 1).is_err());
    }

    #[test]
    fn a_flight_repeats_from_its_seed() {
        roomy(|| {
            let factory = factory();
            let case =
                Case { seed: 7, controller: ControllerKind::Lqi, counterpart: Counterpart::Px4 };
            let [one, two] = [factory.fly(case).unwrap(), factory.fly(case).unwrap()];
            assert_eq!(one.findings, two.findings);
            assert_eq!(one.texts, two.texts);
            assert!(!one.texts.is_empty());
        });
    }

    /// Commands full aileron, whatever the target is.
    #[derive(Clone)]
    struct Hardover;

    impl Controller for Hardover {
        fn name(&self) -> &'static str {
            "hardover"
        }

        fn boxed_clone(&self) -> Box<dyn Controller> {
            Box::new(self.clone())
        }

        fn reset(&mut self, _: u64) {}

        fn command(&mut self, _: &Observation, _: &Target) -> Command {
            Command { aileron: 1.0, elevator: 0.0, throttle: 0.5, rudder: 0.0 }
        }
    }

    #[test]
    fn what_a_controller_does_without_any_fault_is_laid_to_no_fault() {
        roomy(|| {
            let model = fly::model("params/x8/jsbsim.toml".as_ref(), None).unwrap();
            let lqi = companion_with(ControllerKind::Lqi, &model, POLICY.as_ref()).unwrap();
            // this pilot has no envelope limiter, which would limit the bank angle
            let config = Config::for_model(&model).unwrap();
            let pilot = Pilot::new(config, lqi.controller.boxed_clone()).unwrap();
            let hardover = Companion { pilot, controller: Box::new(Hardover), ..lqi };
            let factory = CompanionFactory::new(hardover, &model).unwrap();
            let case =
                Case { seed: 0, controller: ControllerKind::Lqi, counterpart: Counterpart::Sitl };
            let report = factory.fly(case).unwrap();
            let entry = Entry::from(&report);
            let rolled = entry.findings.iter().find(|f| f.finding == "attitude").unwrap();
            assert_eq!(rolled.standing(), "by itself", "{:?}", entry.findings);
            assert!(rolled.is_failure());
        });
    }

    #[test]
    fn a_full_disk_is_told_and_flown_on_with() {
        roomy(|| {
            let factory = factory();
            let disk =
                FaultKind::DRAWN.iter().position(|kind| *kind == FaultKind::Disk).unwrap() as u64;
            let case = Case {
                seed: disk,
                controller: ControllerKind::Lqi,
                counterpart: Counterpart::Sitl,
            };
            let report = factory.fly(case).unwrap();
            assert!(
                report.texts.iter().any(|(_, t)| t.contains("recording of flight")),
                "{report:?}"
            );
            assert!(!report.findings.iter().any(|f| f.finding == Finding::Unreported));
        });
    }
}
