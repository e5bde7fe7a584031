//! `greylag aircraft check`: computes trim, modes, control authority and stability margins of the aircraft that a model
//! describes.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use serde::Serialize;

use crate::commands::files::{self, JsonArgument, Overwrite, shipped};
use crate::commands::given;
use crate::commands::outputs;
use crate::commands::status::IN_DOUBT;
use crate::commands::terminal::print_next;
use crate::control::aircraft_check::{self, AircraftCheck};
use crate::control::stick_response::stick_responses;
use crate::logs::quoted;
use crate::model::GreyBox;
use crate::model::modes::Mode;
use crate::report::AircraftReport;

/// Options of `greylag aircraft check`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Model of the aircraft.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Write an HTML page on the aircraft: three-view drawing, trim, modes, and responses to stick inputs.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgument,
}

/// Result of the check as JSON: SI units, angles in rad.
#[derive(Serialize)]
struct Document<'a> {
    model: &'a str,
    airframe: &'a str,
    #[serde(flatten)]
    found: &'a AircraftCheck,
}

/// Checks the aircraft and prints the results. The exit status is 3 if something should be corrected before a flight.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let written = arguments.json.path().into_iter().chain(&arguments.report);
    outputs::check(written, given::files(&arguments.model), Overwrite::New)?;
    let model = given::model(&arguments.model)?;
    let found = aircraft_check::check(&model)?;
    if !arguments.json.takes_stdout() {
        println!(
            "{} ({}) at {:.1} m/s and {:.0} m",
            model.name,
            model.airframe.name,
            model.airframe.envelope.airspeed_cruise_mps,
            model.airframe.reference.altitude
        );
        print(&found);
        let next = next(&arguments.model, &found);
        print_next(&match found.findings.is_empty() {
            true => next,
            false => corrected(&arguments.model, &next),
        });
    }
    let document = Document { model: &model.name, airframe: &model.airframe.name, found: &found };
    arguments.json.write("greylag.aircraft-check/1", &document, Overwrite::New)?;
    if let Some(path) = &arguments.report {
        files::write(path, &page(&arguments.model, &model)?, Overwrite::New)?;
    }
    Ok(status(&found))
}

/// The exit status: 3 if something should be corrected before a flight.
pub fn status(found: &AircraftCheck) -> ExitCode {
    if found.findings.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(IN_DOUBT) }
}

/// Renders the HTML page on the aircraft of `model`. `file` is the path of the model file.
///
/// # Errors
/// If the aircraft cannot be trimmed or stabilised at its cruise airspeed.
pub fn page(file: &Path, model: &GreyBox) -> Result<String> {
    let found = aircraft_check::check(model)?;
    let report = AircraftReport {
        model,
        check: &found,
        responses: &stick_responses(model)?,
        model_file: file.display().to_string(),
        fitted: is_fitted(file),
        next: next(file, &found),
        command_line: files::command_line(),
    };
    Ok(report.page().render())
}

/// The command to run next: flights of the recommended controller in the model itself, with drawn coefficients, or the check again
/// if something should be corrected. Empty in a build that cannot fly.
fn next(file: &Path, found: &AircraftCheck) -> String {
    let file = quoted(file);
    match found.findings.is_empty() {
        false => format!("greylag aircraft check --model {file}"),
        true if !cfg!(feature = "demo") => String::new(),
        true => {
            format!(
                "greylag evaluate --controller {} --model {file} --draws 20",
                found.controller.name
            )
        }
    }
}

/// The next step with findings: the file to edit, and the command `next` after that.
fn corrected(file: &Path, next: &str) -> String {
    format!("correct {} or its airframe file, then run {next}", file.display())
}

/// Whether `greylag amend` fitted coefficients in the model file to flights. It notes this in their sources.
fn is_fitted(file: &Path) -> bool {
    std::fs::read_to_string(shipped(file)).is_ok_and(|text| text.contains("; fitted to "))
}

/// Prints trim, modes, control authority and the stability margins of the loops, then what should be corrected.
pub fn print(found: &AircraftCheck) {
    println!("\n{}", levels(found));
    println!("\n{}", modes(found));
    let authority = found.authority;
    println!(
        "\nfull aileron rolls at {:.0} deg/s, full elevator pitches by {:.0} deg/s2{}",
        authority.roll_rate.to_degrees(),
        authority.pitch_acceleration.to_degrees(),
        authority.yaw_acceleration.map_or_else(String::new, |yaw| format!(
            ", full rudder yaws by {:.0} deg/s2",
            yaw.to_degrees()
        ))
    );
    if found.designed {
        println!("\n{}", loops(found));
    }
    println!();
    if let Some(fastest) = found.level_up_to {
        println!("cannot fly level above {fastest:.1} m/s: faster is a descent at full throttle");
    }
    let controller = &found.controller;
    if found.designed {
        println!(
            "controller to begin with: {}, whose loops tolerate {:.0} ms of delay",
            controller.name,
            1e3 * controller.delay_s
        );
    }
    match found.findings.is_empty() {
        true => println!("nothing to correct by its own numbers; no flight was compared"),
        false => found.findings.iter().for_each(|finding| println!("correct: {finding}")),
    }
}

fn table(header: &[&str], rows: impl Iterator<Item = Vec<String>>) -> Table {
    let mut table = Table::new();
    table.load_style(NOTHING).set_header(header.iter().copied());
    rows.for_each(|row| {
        table.add_row(row);
    });
    table
}

fn levels(found: &AircraftCheck) -> Table {
    let rows = found.levels.iter().map(|l| {
        vec![
            format!("{:.1}", l.airspeed),
            format!("{:.1}", l.alpha.to_degrees()),
            format!("{:.0}", 100.0 * l.elevator),
            format!("{:.0}", 100.0 * l.throttle),
            format!("{:.1}", l.path.to_degrees()),
            if l.is_possible() { String::new() } else { "impossible".into() },
        ]
    });
    table(
        &[
            "straight flight, m/s",
            "incidence, deg",
            "elevator, %",
            "throttle, %",
            "flight path, deg",
            "",
        ],
        rows,
    )
}

fn modes(found: &AircraftCheck) -> Table {
    let oscillating =
        |m: &Mode, x: f64| if m.oscillates() { format!("{x:.2}") } else { "-".into() };
    let rows = found.modes.iter().map(|m| {
        let constant = m.time_constant();
        let fate = if constant < 0.0 { "grows" } else { "decays" };
        vec![
            m.name.to_owned(),
            oscillating(m, m.frequency()),
            oscillating(m, m.damping()),
            format!("{:.2}", constant.abs()),
            fate.to_owned(),
        ]
    });
    table(&["mode", "frequency, rad/s", "damping", "time constant, s", ""], rows)
}

fn loops(found: &AircraftCheck) -> Table {
    let decibel =
        |x: f64| if x.is_finite() { format!("{:.1}", 20.0 * x.log10()) } else { "any".into() };
    let rows = found.named_loops().map(|(controller, l)| {
        let [least, most] = l.gain;
        vec![
            controller.to_owned(),
            l.surface.to_owned(),
            format!("{:.1}", l.crossover),
            if least > 0.0 { decibel(least) } else { "any".into() },
            decibel(most),
            format!("{:.0}", l.phase.to_degrees()),
            format!("{:.0}", 1e3 * l.delay),
        ]
    });
    let header = [
        "controller",
        "loop",
        "crossover, rad/s",
        "least gain, dB",
        "most gain, dB",
        "phase, deg",
        "delay, ms",
    ];
    table(&header, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An aircraft whose elevator and ailerons have almost no effect, as a fit may leave them.
    #[test]
    fn what_is_to_be_corrected_ends_with_the_file() {
        let mut model = given::model(Path::new("params/aerosonde/jsbsim.toml")).unwrap();
        assert!(model.set_coefficient("pitch_linear.Cmde", -0.02));
        let found = aircraft_check::check(&model).unwrap();
        let file = Path::new("own/model.toml");
        let next = next(file, &found);
        let said = corrected(file, &next);
        assert_eq!(
            said,
            "correct own/model.toml or its airframe file, then run greylag aircraft check --model own/model.toml"
        );
        assert!(levels(&found).to_string().contains("impossible"), "{}", levels(&found));
    }
}
