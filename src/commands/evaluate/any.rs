//! `greylag evaluate --any`: flies controllers on aircraft drawn from a distribution, and on the aircraft of given models.
//!
//! Each flight takes one minute and has twelve commanded attitudes. A drawn aircraft has an exact model, which simulates it,
//! and a textbook model, which is estimated from its mass and dimensions. An aircraft is lost if it leaves the limits of
//! attitude, flow angles and airspeed. The settled error is the attitude error in the last second of each attitude.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use comfy_table::Table;
use rayon::prelude::*;
use serde::Serialize;

use super::{Arguments, derivatives, progress};
use crate::commands::files::{self, shipped};
use crate::control::aircraft_estimate::AircraftEstimator;
use crate::control::{ControllerKind, Needs, build};
use crate::model::GreyBox;
use crate::model::population::{Drawn, Layout, Population};
use crate::num::statistics::quantile;
use crate::sim::attitudes::{self, Minute};
use crate::sim::changes::{Change, Changed, Elevons};

/// Options of `--any`.
#[derive(clap::Args)]
pub(super) struct AnyArguments {
    /// Distribution that --any draws from.
    #[arg(long, value_name = "FILE", default_value = "params/any/aircraft.toml", requires = "any")]
    pub(super) population: PathBuf,
    /// Fly each drawn aircraft also with each of these changes after 30 s: half the aileron, mass +30 %, centre of gravity 5 %
    /// of the chord aft, one elevon or aileron stuck.
    #[arg(long, requires = "any")]
    change: bool,
    /// Models whose aircraft --any flies too. A controller that needs a model is designed from the model that it flies.
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "any")]
    pub(super) beside: Vec<PathBuf>,
}

/// Information from which a controller is designed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Knowledge {
    /// Cruise airspeed, and whether the aircraft has a rudder.
    Nothing,
    /// The textbook model, estimated from mass, span, area and tail.
    Textbook,
    /// The exact model, which also simulates the aircraft.
    Exact,
}

impl Knowledge {
    fn name(self) -> &'static str {
        match self {
            Knowledge::Nothing => "cruise airspeed",
            Knowledge::Textbook => "textbook",
            Knowledge::Exact => "own model",
        }
    }
}

/// One flight of one minute with one aircraft and one controller.
#[derive(Serialize)]
pub(super) struct Flight {
    aircraft: String,
    pub(super) controller: &'static str,
    knows: Knowledge,
    /// Name of the change of the aircraft after 30 s. `None` if the aircraft does not change.
    #[serde(skip_serializing_if = "Option::is_none")]
    change: Option<&'static str>,
    /// Results of the flight. `None` if no controller could be designed.
    minute: Option<Minute>,
    /// Derivatives estimated in this flight, divided by those of the exact model, in the order of `DERIVATIVES`. `None` for a
    /// derivative that the flight does not determine. Empty if the aircraft changes or cannot be trimmed.
    pub(super) derivative_ratios: Vec<Option<f64>>,
}

#[derive(Serialize)]
struct AnyDocument<'a> {
    schema: &'static str,
    program: &'static str,
    command_line: String,
    seed: u32,
    drawn: u32,
    flights: &'a [Flight],
}

/// Flies `count` drawn aircraft and those of `--beside`, prints the tables and writes the JSON.
pub(super) fn fly(arguments: &Arguments, count: u32) -> Result<ExitCode> {
    let kinds = &arguments.controllers;
    if let Some(kind) =
        kinds.iter().find(|kind| !matches!(kind.needs(), Needs::Gains | Needs::Model))
    {
        bail!("--any flies controllers that need no policy; leave {kind} out");
    }
    let population = Population::load(&shipped(&arguments.of_any.population))?;
    let load = |path: &PathBuf| GreyBox::load(&shipped(path));
    let beside = arguments.of_any.beside.iter().map(load).collect::<Result<Vec<_>, _>>()?;
    let after = Change::ALL.into_iter().filter(|_| arguments.of_any.change).map(Some);
    let changes: Vec<Option<Change>> = [None].into_iter().chain(after).collect();
    let bar = progress(count.into(), "aircraft", "drawn aircraft");
    let seed = u64::from(arguments.seed);
    let flown: Result<Vec<Vec<Flight>>> = (0..u64::from(count))
        .into_par_iter()
        .map(|number| {
            let drawn = population.draw(seed, number)?;
            bar.inc(1);
            of_drawn(kinds, &drawn, seed, &changes)
        })
        .collect();
    let (drawn, changed): (Vec<Flight>, Vec<Flight>) =
        flown?.into_iter().flatten().partition(|f| f.change.is_none());
    bar.finish_and_clear();
    let others: Vec<Vec<Flight>> =
        beside.par_iter().map(|model| of_model(kinds, model, seed)).collect();
    let others: Vec<Flight> = others.into_iter().flatten().collect();
    if !files::is_stdout(arguments.json.as_deref()) {
        print(kinds, &drawn, &changed, &others);
    }
    let flights: Vec<Flight> = drawn.into_iter().chain(changed).chain(others).collect();
    if let Some(path) = &arguments.json {
        let document = AnyDocument {
            schema: "greylag.any-aircraft/1",
            program: concat!("greylag ", env!("CARGO_PKG_VERSION")),
            command_line: files::command_line(),
            seed: arguments.seed,
            drawn: count,
            flights: &flights,
        };
        let text = serde_json::to_string_pretty(&document)? + "\n";
        files::write(path, &text, arguments.force.into())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints the tables of the drawn aircraft, of those after a change, and of the aircraft of given models.
fn print(kinds: &[ControllerKind], drawn: &[Flight], changed: &[Flight], others: &[Flight]) {
    println!("{}", summary(kinds, drawn));
    println!("{}", derivatives::table(kinds, drawn));
    println!(
        "estimated in the minute from body rates and deflections, without a model: error relative to the aircraft's own derivative, and the \
         share of flights that reveal it"
    );
    println!(
        "lost: beyond recovery within 60 s of 12 random attitudes; settled and integral: of those kept, the integral relative to that of"
    );
    println!(
        "the first controller designed from the aircraft's own model, aircraft by aircraft; medians, then the 90th percentile"
    );
    if !changed.is_empty() {
        println!("{}", after_changes(kinds, drawn, changed));
        println!(
            "kept: after a change at 30 s, of the aircraft that the controller keeps without it; settled: over the whole minute"
        );
    }
    if !others.is_empty() {
        println!("{}", one_by_one(others));
    }
}

/// Information from which a controller of this kind can be designed.
fn knowledge(kind: ControllerKind) -> &'static [Knowledge] {
    match kind.needs() {
        Needs::Gains => &[Knowledge::Nothing],
        _ => &[Knowledge::Exact, Knowledge::Textbook],
    }
}

fn of_drawn(
    kinds: &[ControllerKind],
    drawn: &Drawn,
    seed: u64,
    changes: &[Option<Change>],
) -> Result<Vec<Flight>> {
    let elevons = match drawn.layout {
        Layout::Elevons => Elevons::Yes,
        _ => Elevons::No,
    };
    let changed = |change: &Option<Change>| {
        change.map(|change| Changed::new(change, &drawn.exact, elevons)).transpose()
    };
    let changes = changes.iter().map(changed).collect::<Result<Vec<_>, _>>()?;
    let all =
        kinds.iter().flat_map(|kind| knowledge(*kind).iter().map(move |knows| (*kind, *knows)));
    let flights = all.flat_map(|(kind, knows)| {
        let from = if knows == Knowledge::Textbook { &drawn.textbook } else { &drawn.exact };
        of_controller((kind, knows), [from, &drawn.exact], [seed, drawn.number], &changes)
    });
    Ok(flights.collect())
}

fn of_model(kinds: &[ControllerKind], model: &GreyBox, seed: u64) -> Vec<Flight> {
    let of = |kind: &ControllerKind| {
        of_controller((*kind, knowledge(*kind)[0]), [model; 2], [seed, 0], &[None])
    };
    kinds.iter().flat_map(of).collect()
}

/// Flies the aircraft of the model `exact` with a controller designed from the model `from`, once for each change.
fn of_controller(
    (kind, knows): (ControllerKind, Knowledge),
    [from, exact]: [&GreyBox; 2],
    flight: [u64; 2],
    changes: &[Option<Changed>],
) -> Vec<Flight> {
    // one controller serves all changes, because the design of an LQI takes longer than the simulation of its flight
    let mut controller = build(kind, from).ok();
    let mut fly = |changed: &Option<Changed>| {
        let mut estimator = AircraftEstimator::new(&exact.airframe);
        let minute = controller.as_mut().map(|c| {
            attitudes::fly_watched(exact, c.as_mut(), flight, changed.as_ref(), |seen| {
                estimator.see(seen.time, &seen.state, &seen.actuators);
            })
        });
        Flight {
            aircraft: exact.airframe.name.clone(),
            controller: kind.name(),
            knows,
            change: changed.as_ref().map(|c| c.change().name()),
            minute,
            derivative_ratios: match changed {
                None => derivatives::ratios(&estimator, exact),
                Some(_) => Vec::new(),
            },
        }
    };
    changes.iter().map(&mut fly).collect()
}

/// A table with one row for each controller, its information and a change. It counts the aircraft that the controller does not
/// lose without a change. It states the percentage of them that are not lost with the change either, and their settled error.
fn after_changes(kinds: &[ControllerKind], before: &[Flight], after: &[Flight]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["controller", "knows", "change", "aircraft", "kept %", "settled °", "90 %"]);
    for kind in kinds {
        for knows in knowledge(*kind) {
            let own = |f: &&Flight| f.controller == kind.name() && f.knows == *knows;
            let unchanged: Vec<&Flight> = before.iter().filter(own).collect();
            for change in Change::ALL {
                let changed = after.iter().filter(own).filter(|f| f.change == Some(change.name()));
                // both lists have the aircraft in the same order
                let pairs = unchanged.iter().zip(changed).filter(|(u, _)| kept(u).is_some());
                let flights: Vec<&Flight> = pairs.map(|(_, c)| c).collect();
                let minutes: Vec<f64> =
                    flights.iter().filter_map(|f| Some(kept(f)?.settled_deg)).collect();
                let mut row = [kind.name(), knows.name(), change.name()].map(String::from).to_vec();
                row.extend([flights.len().to_string(), percent(minutes.len(), flights.len(), 1)]);
                row.extend([0.5, 0.9].map(|q| match minutes.is_empty() {
                    true => "-".to_owned(),
                    false => format!("{:.2}", quantile(&minutes, q)),
                }));
                table.add_row(row);
            }
        }
    }
    table
}

/// A table over all drawn aircraft: one row for each controller and the information from which it is designed.
fn summary(kinds: &[ControllerKind], flights: &[Flight]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header([
        "controller",
        "knows",
        "aircraft",
        "lost %",
        "settled °",
        "90 %",
        "integral",
        "90 %",
    ]);
    let reference: Vec<&Flight> = {
        let first = kinds.iter().find(|kind| kind.needs() == Needs::Model);
        let own = |f: &&Flight| {
            first.is_some_and(|k| k.name() == f.controller) && f.knows == Knowledge::Exact
        };
        flights.iter().filter(own).collect()
    };
    for kind in kinds {
        for knows in knowledge(*kind) {
            let of: Vec<&Flight> = flights
                .iter()
                .filter(|f| f.controller == kind.name() && f.knows == *knows)
                .collect();
            table.add_row(row([kind.name(), knows.name()], &of, &reference));
        }
    }
    table
}

/// `some` as a percentage of `all`; a dash if `all` is zero, for example if every aircraft was lost.
pub(super) fn percent(some: usize, all: usize, digits: usize) -> String {
    match all {
        0 => "-".into(),
        _ => format!("{:.digits$}", 100.0 * some as f64 / all as f64),
    }
}

pub(super) fn kept(flight: &Flight) -> Option<Minute> {
    flight.minute.filter(|m| m.lost_s.is_none())
}

fn row([controller, knows]: [&str; 2], flights: &[&Flight], reference: &[&Flight]) -> Vec<String> {
    let flown: Vec<Minute> = flights.iter().filter_map(|f| kept(f)).collect();
    let settled: Vec<f64> = flown.iter().map(|m| m.settled_deg).collect();
    let ratios: Vec<f64> = flights
        .iter()
        .zip(reference)
        .filter_map(|(f, r)| Some(kept(f)?.integral_deg_s / kept(r)?.integral_deg_s))
        .collect();
    let lost = percent(flights.len() - flown.len(), flights.len(), 1);
    let both = |all: &[f64], digits: usize| {
        [0.5, 0.9].map(|q| match all.is_empty() {
            true => "-".to_owned(),
            false => format!("{:.digits$}", quantile(all, q)),
        })
    };
    let mut row = vec![controller.into(), knows.into(), flights.len().to_string(), lost];
    row.extend(both(&settled, 2));
    row.extend(both(&ratios, 2));
    row
}

fn one_by_one(flights: &[Flight]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["aircraft", "controller", "knows", "lost at s", "settled °", "integral ° s"]);
    for f in flights {
        let mut row = vec![f.aircraft.clone(), f.controller.into(), f.knows.name().into()];
        row.extend(match &f.minute {
            None => ["no design", "", ""].map(String::from),
            Some(m) => [
                m.lost_s.map_or("kept".into(), |s| format!("{s:.1}")),
                format!("{:.2}", m.settled_deg),
                format!("{:.0}", m.integral_deg_s),
            ],
        });
        table.add_row(row);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_no_flights_is_a_dash() {
        let kinds = [ControllerKind::Adaptive];
        let tables = [after_changes(&kinds, &[], &[]), derivatives::table(&kinds, &[])];
        for table in tables.map(|table| table.to_string()) {
            assert!(table.contains("adaptive") && !table.contains("NaN"), "{table}");
        }
    }

    #[test]
    fn an_option_that_drawn_aircraft_ignore_is_refused() {
        use clap::Parser;
        let line = ["greylag", "evaluate", "--any", "2", "--controller", "lqi"];
        let read =
            |more: &[&str]| crate::commands::Arguments::try_parse_from([&line[..], more].concat());
        assert!(read(&[]).is_ok());
        for more in [["--envelope", "kept"], ["--planner", "horizon=5"], ["--model", "m.toml"]] {
            assert!(read(&more).is_err(), "{more:?}");
        }
    }
}
