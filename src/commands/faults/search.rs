//! `greylag faults --search`: searches for simulated flights with faults that violate a flight rule. The robustness of a rule
//! is its normalised margin in a flight, −1 to 1: negative if the flight violates the rule.

use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use serde::Serialize;

use crate::commands::bar::Bar;
use crate::commands::files::{JsonArgument, Overwrite};
use crate::sim::faults::policies::policies;
use crate::sim::faults::search::{Nearest, distances, search};
use crate::sim::faults::{CompanionFactory, Counterpart, Scenario};
use crate::sysid::progress::Stage;

/// Inputs of a search.
pub(super) struct Search<'a> {
    pub(super) factory: &'a CompanionFactory,
    pub(super) counterparts: &'a [Counterpart],
    pub(super) flights: u64,
    pub(super) seed: u64,
    pub(super) json: &'a JsonArgument,
}

/// Result of the search for one rule, as JSON. `distance` is the smallest robustness and `at_s` its time in the flight, s.
#[derive(Serialize)]
struct Row<'a> {
    policy: &'a str,
    asks: &'a str,
    flights: u64,
    broken: u64,
    distance: Option<f64>,
    at_s: f64,
    /// The flight with the smallest robustness. If it violates the rule, it was simplified, for example by removing faults, as
    /// long as the violation remained.
    scenario: Option<&'a Scenario>,
}

#[derive(Serialize)]
struct Document<'a> {
    seed: u64,
    policies: Vec<Row<'a>>,
}

/// Runs the search and prints the smallest robustness of each rule. The exit status is 1 if a rule was violated.
pub(super) fn run(search_for: &Search) -> Result<ExitCode> {
    let Search { factory, counterparts, flights, seed, json } = *search_for;
    let bar = Bar::new();
    let found = search(factory, counterparts, flights, seed, &mut |flown, broken| {
        let doing = format!("searching; rules broken: {broken}");
        bar.update(Stage { doing: &doing, fraction: flown as f64 / flights as f64, ranking: &[] })
    })?;
    drop(bar);
    let rows = found.iter().map(row).collect();
    json.write("greylag.faults.search/1", &Document { seed, policies: rows }, Overwrite::New)?;
    if !json.takes_stdout() {
        print(&found);
    }
    let broken = found.iter().any(|nearest| nearest.broken > 0);
    Ok(if broken { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn row(nearest: &Nearest) -> Row<'_> {
    Row {
        policy: nearest.policy,
        asks: nearest.asks,
        flights: nearest.flights,
        broken: nearest.broken,
        distance: nearest.distance.is_finite().then_some(nearest.distance),
        at_s: nearest.at_s,
        scenario: nearest.scenario.as_ref(),
    }
}

fn print(found: &[Nearest]) {
    println!("distance 1 is far from breaking a rule, below 0 it is broken");
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(["rule", "flights", "broken", "least distance", "at (s)", "asks"]);
    for n in found.iter().filter(|n| n.flights > 0) {
        table.add_row([
            n.policy.to_owned(),
            n.flights.to_string(),
            n.broken.to_string(),
            format!("{:.3}", n.distance),
            format!("{:.2}", n.at_s),
            n.asks.to_owned(),
        ]);
    }
    println!("{table}");
    for n in found.iter().filter(|n| n.broken > 0) {
        let Some(scenario) = &n.scenario else { continue };
        // serialisation cannot fail: a scenario consists of numbers and names
        let text = serde_json::to_string(scenario).unwrap_or_default();
        println!(
            "\n{}, the smallest flight found; `greylag faults --scenario FILE` flies it:\n{text}",
            n.policy
        );
    }
}

/// Flies the scenario in `file` and prints the robustness of each rule. The exit status is 1 if a rule was violated.
pub(super) fn fly(factory: &CompanionFactory, file: &Path) -> Result<ExitCode> {
    let text = crate::physics::text_file::read(file)
        .with_context(|| format!("reading the scenario {}", file.display()))?;
    let scenario: Scenario = serde_json::from_str(&text).with_context(|| {
        format!("{} holds no scenario; give a file of what --search prints", file.display())
    })?;
    if let Err(why) = scenario.check() {
        bail!("{} holds no scenario: {why}", file.display());
    }
    let rules = policies(&factory.envelope());
    let judged = distances(factory, &rules, &scenario)?;
    let mut broken = false;
    for (rule, judged) in rules.iter().zip(judged) {
        let Some((distance, at_s)) = judged else { continue };
        broken |= distance < 0.0;
        let word = if distance < 0.0 { "BROKEN" } else { "held" };
        println!("{word:6} {distance:6.3} at {at_s:5.2} s  {}: {}", rule.id, rule.asks);
    }
    Ok(if broken { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}
