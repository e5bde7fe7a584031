//! `greylag faults`: a campaign of seeded flights under faults, judged automatically.

mod flight;
mod judge;
mod mix;
mod wire;

use std::collections::BTreeMap;
use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use rayon::prelude::*;

use crate::commands::choices;
use crate::commands::fly;
use crate::control::Kind as ControllerKind;
use flight::{Case, Opposite, Report, Works};
use judge::Finding;
use mix::Kind;

/// The arguments of `greylag faults`.
#[derive(Args)]
pub struct Arguments {
    /// Flights with each controller at each opposite.
    #[arg(long, value_name = "N", default_value_t = 100)]
    flights: u64,
    /// Seed of the first flight; the others follow.
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    first: u64,
    /// Controllers.
    #[arg(long, value_name = "NAME", num_args = 1.., default_values = ["lqi"], value_parser = choices::controller())]
    controller: Vec<ControllerKind>,
    /// What is at the other end of the vehicle's link.
    #[arg(long, value_name = "NAME", num_args = 1.., default_values = ["sitl", "px4", "ardupilot"], value_enum)]
    opposite: Vec<Opposite>,
    /// Show what befell each flight with a finding, and what was said.
    #[arg(long)]
    show: bool,
}

/// Flies the campaign; the exit status tells whether the companion itself never failed.
///
/// # Errors
/// If an aircraft or a controller cannot be made.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let model = fly::model("params/x8/jsbsim.toml".as_ref(), None)?;
    let mut reports = Vec::new();
    for &controller in &arguments.controller {
        let works = Works::new(controller, &model)?;
        for &opposite in &arguments.opposite {
            let seeds = arguments.first..arguments.first + arguments.flights;
            let flown: Result<Vec<Report>> = seeds
                .into_par_iter()
                .map(|seed| works.fly(Case { seed, controller, opposite }))
                .collect();
            let flown = flown?;
            print_table(controller, opposite, &flown);
            reports.extend(flown);
        }
    }
    print_findings(&reports, arguments.show);
    let own = [Finding::Panic, Finding::Command, Finding::Slew, Finding::SlowHandBack];
    let failed = reports.iter().any(|r| r.findings.iter().any(|(_, f)| own.contains(f)));
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Fault against finding: flights with that fault among theirs, flights of these with that finding.
fn print_table(controller: ControllerKind, opposite: Opposite, reports: &[Report]) {
    println!("\n{} at {}: {} flights of 60 s", controller.name(), opposite.name(), reports.len());
    let mut table = Table::new();
    table.load_style(NOTHING);
    let names = Finding::ALL.map(Finding::name);
    table.set_header(["fault", "flights"].into_iter().chain(names));
    for kind in Kind::ALL {
        let with: Vec<&Report> =
            reports.iter().filter(|r| r.faults.iter().any(|f| f.kind == kind)).collect();
        let counts = Finding::ALL.map(|finding| {
            let count =
                with.iter().filter(|r| r.findings.iter().any(|(_, f)| *f == finding)).count();
            if count == 0 { "·".to_owned() } else { count.to_string() }
        });
        let head = [kind.name().to_owned(), with.len().to_string()];
        table.add_row(head.into_iter().chain(counts));
    }
    println!("{table}");
}

/// Every flight with a finding, with the options that fly it again.
fn print_findings(reports: &[Report], show: bool) {
    let mut counts: BTreeMap<Finding, u64> = BTreeMap::new();
    for report in reports {
        report.findings.iter().for_each(|(_, f)| *counts.entry(*f).or_default() += 1);
    }
    println!("\n{} flights in all", reports.len());
    for (finding, count) in &counts {
        println!("  {}: {count}", finding.name());
    }
    let found: Vec<&Report> = reports.iter().filter(|r| !r.findings.is_empty()).collect();
    let limit = if show { found.len() } else { 20 };
    for report in found.iter().take(limit) {
        let what: Vec<String> = report
            .findings
            .iter()
            .map(|(at, finding)| format!("{} at {at:.2} s", finding.name()))
            .collect();
        println!("greylag faults {}: {}", report.case, what.join(", "));
        if show {
            for f in &report.faults {
                let (kind, s) = (f.kind.name(), f.strength);
                println!("    {:6.2} to {:6.2} s: {kind}, strength {s:.2}", f.from_s, f.to_s);
            }
            report.texts.iter().for_each(|text| println!("    said: {text}"));
        }
    }
    if found.len() > limit {
        println!("… and {} more; --show shows them all", found.len() - limit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_flights_with_every_fault_leave_the_companion_sound() {
        let model = fly::model("params/x8/jsbsim.toml".as_ref(), None).unwrap();
        let works = Works::new(ControllerKind::Lqi, &model).unwrap();
        for opposite in [Opposite::Sitl, Opposite::Px4, Opposite::ArdupilotAttitude] {
            // Fifteen kinds of faults: each comes first once in fifteen seeds.
            for seed in (0..15).step_by(3) {
                let case = Case { seed, controller: ControllerKind::Lqi, opposite };
                let report = works.fly(case).unwrap();
                let own = [Finding::Panic, Finding::Command, Finding::Slew, Finding::SlowHandBack];
                assert!(
                    !report.findings.iter().any(|(_, f)| own.contains(f)),
                    "{case}: {:?} {:?}",
                    report.findings,
                    report.texts
                );
            }
        }
    }

    #[test]
    fn a_flight_repeats_from_its_seed() {
        let model = fly::model("params/x8/jsbsim.toml".as_ref(), None).unwrap();
        let works = Works::new(ControllerKind::Lqi, &model).unwrap();
        let case = Case { seed: 7, controller: ControllerKind::Lqi, opposite: Opposite::Px4 };
        let [one, two] = [works.fly(case).unwrap(), works.fly(case).unwrap()];
        assert_eq!(one.findings, two.findings);
        assert_eq!(one.texts, two.texts);
    }
}
