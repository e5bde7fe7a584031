//! `greylag diagnose`: finds the effects (physical contributions to forces and moments) that a model lacks.

mod next;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use comfy_table::{CellAlignment, Table};
use serde::Serialize;

use crate::commands::bar::{Bar, shares};
use crate::commands::distinct::distinct;
use crate::commands::effect_files::{effect_paths, file_words, named_effects};
use crate::commands::files;
use crate::commands::given;
use crate::commands::intake::{Intake, LogArguments};
use crate::commands::outputs;
use crate::commands::per_flight::PerFlightArguments;
use crate::commands::status::IN_DOUBT;
use crate::commands::terminal::{self, NORMAL_95, noted, print_answer, print_summary};
use crate::model::GreyBox;
use crate::report::DiagnosisReport;
use crate::sysid::amend::{Diagnosed, diagnosed};
use crate::sysid::compare::{self, Answer, compare};
use crate::sysid::diagnose::{Candidate, Diagnosis, Options, Status, diagnose};
use crate::sysid::flight_path::ActuatorClock;
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::per_flight::askew;
use crate::sysid::progress::{Progress, Stage, part};

/// Largest number of candidates in the table. A candidate is an effect that the model may lack.
const ROWS: usize = 12;

/// Options of `greylag diagnose`.
#[derive(clap::Args)]
#[command(
    after_help = "Exit status: 0 done, whatever was found; 1 nothing could be diagnosed; 3 done, but a log was left out or holds what makes the figures wrong, or a figure was found that cannot be. The verdict is in the output: effect, adequate, unexplained or unknown."
)]
pub struct Arguments {
    /// The model file of the aircraft.
    #[arg(long, env = "GREYLAG_MODEL", hide_env_values = true)]
    model: PathBuf,
    #[command(flatten)]
    logs: LogArguments,
    /// Write the complete diagnosis as JSON; with `-` it goes to standard output, and the usual text is not printed.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write a report as one HTML page to this file.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Number of bootstrap draws under the null hypothesis (no effect is missing), which give the thresholds of the evidence.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u16).range(20..))]
    nulls: u16,
    /// Seed of all random draws.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Effect files (TOML) or folders of them, tried as candidates in addition to the catalogue of known effects.
    #[arg(long = "effect", value_name = "FILE", num_args = 1..)]
    effects: Vec<String>,
    /// Ids of effects of the catalogue that are not to be tried.
    #[arg(long, num_args = 1..)]
    without: Vec<String>,
    #[command(flatten)]
    per_flight: PerFlightArguments,
    /// Replace the JSON and the report if they exist.
    #[arg(long)]
    force: bool,
}

/// Note on a model that `amend` refuses.
const WITH_RESIDUAL: &str = "The model has a learned residual, which was fitted with its coefficients: an effect is added to the \
                             model without it (its prior), and the residual is then learned again.";

/// Note on free runs for which the delay of the recorded deflections is removed.
const CORRECTED: &str = "Only for the errors of free runs, the delay of the recorded actuators is removed, as `compare` does.";

/// Note on free runs with the recorded deflections.
const AS_RECORDED: &str = "The errors of free runs are computed with the actuators as recorded, because an effect explains why they \
                           come late: `compare --recorded-clock` gives the same.";

/// Reads the logs, reconstructs the flights and diagnoses the model. Prints sentences and tables, and writes JSON and report.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let overwrite = arguments.force.into();
    outputs::check(arguments.json.iter().chain(&arguments.report), inputs(arguments), overwrite)?;
    distinct(&arguments.logs.paths, &[])?;
    let model = given::model(&arguments.model)?;
    let Intake { flights, mut notes, in_doubt, used, .. } =
        arguments.logs.take_in(&model, ActuatorClock::AsRecorded)?;
    let options = Options {
        seed: arguments.seed,
        nulls: arguments.nulls.into(),
        with: named_effects(&arguments.effects)?,
        without: arguments.without.clone(),
        per_flight: arguments.per_flight.asked(),
        ..Options::default()
    };
    let bar = Bar::new();
    let on_stage = |stage: Stage<'_>| bar.update(stage);
    let [searching, drawing] = shares(arguments.report.as_deref());
    let mut diagnosis = diagnose(&model, &flights, &options, &part(&on_stage, searching))?;
    for flight in &flights {
        notes.extend(flight.notes.iter().map(|note| format!("{}: {note}", flight.name)));
    }
    notes.extend(model.residual.as_ref().map(|_| WITH_RESIDUAL.to_owned()));
    notes.append(&mut diagnosis.notes);
    diagnosis.notes = notes;
    let flights = clocked(flights, &model, &mut diagnosis);
    let Diagnosed { tuned, answer } = diagnosed(&model, &flights, &diagnosis)?;
    let words = file_words(&arguments.effects)?;
    let logs = arguments.logs.among(&used);
    let next = next::next((arguments, &logs), &model, &diagnosis, &words, &answer);
    let answer = answer.then(next);
    // the page is drawn before anything is written, so that Ctrl-C leaves no file behind
    let drawn = arguments.report.as_ref().map(|path| {
        let mut models = [tuned, model.clone()];
        models[1].name = "as given".into();
        let told = (&diagnosis, &answer);
        let page = page(arguments, told, &words, &models, &flights, &part(&on_stage, drawing))?;
        Ok::<_, anyhow::Error>((path, page))
    });
    let drawn = drawn.transpose()?;
    bar.go_on()?;
    drop(bar);
    if !files::is_stdout(arguments.json.as_deref()) {
        print_answer(&answer);
        print(&diagnosis);
    }
    if let Some(path) = &arguments.json {
        let document = Document { diagnosis: &diagnosis, answer: &answer };
        files::write(path, &(serde_json::to_string_pretty(&document)? + "\n"), overwrite)?;
    }
    if let Some((path, page)) = drawn {
        files::write(path, &page, overwrite)?;
    }
    let in_doubt = in_doubt || !diagnosis.doubtful.is_empty();
    if !files::is_stdout(arguments.json.as_deref()) {
        print_summary(&answer);
    }
    Ok(if in_doubt { ExitCode::from(IN_DOUBT) } else { ExitCode::SUCCESS })
}

/// The files that the command reads.
fn inputs(arguments: &Arguments) -> Vec<PathBuf> {
    let logs = arguments.logs.files().cloned();
    given::files(&arguments.model)
        .into_iter()
        .chain(logs)
        .chain(effect_paths(&arguments.effects))
        .collect()
}

/// The flights of `diagnosis`, which used the recorded deflections, on the time base on which `compare` computes free runs. If a
/// delay of the deflections is significant, a note of the diagnosis states what becomes of it.
fn clocked(
    flights: Vec<Reconstruction>,
    model: &GreyBox,
    diagnosis: &mut Diagnosis,
) -> Vec<Reconstruction> {
    if flights.iter().all(|flight| flight.actuators_late().is_none()) {
        return flights;
    }
    let asserted = diagnosis.effects.iter().filter(|c| c.asserted).map(|c| c.id.as_str());
    let clock = ActuatorClock::beside(asserted.chain(model.effects().map(|about| about.id)));
    let (flights, note) = match clock {
        ActuatorClock::Estimated => {
            (flights.into_iter().map(Reconstruction::with_corrected_clock).collect(), CORRECTED)
        }
        ActuatorClock::AsRecorded => (flights, AS_RECORDED),
    };
    diagnosis.notes.push(note.into());
    flights
}

/// Content of the JSON document: the diagnosis, with the answer that the terminal and the page show first.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    answer: &'a Answer,
}

/// The report as HTML, with the errors of the models by channel and flight condition.
fn page(
    arguments: &Arguments,
    (diagnosis, answer): (&Diagnosis, &Answer),
    effect_files: &BTreeMap<String, String>,
    models: &[GreyBox],
    flights: &[Reconstruction],
    progress: &Progress,
) -> Result<String> {
    let failing = compare(models, flights, &compare::Options::default(), progress)?;
    let report = DiagnosisReport {
        title: match diagnosis.effects.iter().any(|e| e.asserted) {
            true => format!("What {} lacks", diagnosis.model),
            false => format!("Does {} lack anything?", diagnosis.model),
        },
        diagnosis,
        answer: Some(answer),
        failing: Some(&failing),
        held_out: None,
        model_file: arguments.model.display().to_string(),
        effect_files: effect_files.clone(),
        log_files: arguments.logs.paths.iter().map(|p| p.display().to_string()).collect(),
        command_line: files::command_line(),
        versions: vec![("greylag".into(), env!("CARGO_PKG_VERSION").into())],
    };
    Ok(report.page().render())
}

fn print(diagnosis: &Diagnosis) {
    println!("{}", diagnosis.model);
    diagnosis.sentences.iter().for_each(|sentence| println!("  {sentence}"));
    println!("\n{}\n{}", effects(diagnosis), channels(diagnosis));
    if let Some(own) = own(diagnosis) {
        println!("{own}");
    }
    for advice in &diagnosis.advice {
        println!("fly {}: {}", advice.manoeuvre, advice.why);
    }
    diagnosis.notes.iter().for_each(|note| println!("{}", noted(note)));
}

fn table<const N: usize>(header: [&str; N]) -> Table {
    terminal::table(header, usize::MAX)
}

fn effects(diagnosis: &Diagnosis) -> Table {
    let mut table =
        table(["effect", "evidence", "by chance", "estimate", "channels", "could have been seen"]);
    for column in table.column_iter_mut().skip(1).take(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    for c in diagnosis.effects.iter().take(ROWS) {
        let verdict = match c.status {
            Status::Missing => " (missing)",
            Status::Indistinguishable => " (missing, or what it cannot be told from)",
            Status::Small => " (seen, small)",
            Status::Refused if !c.refused.is_empty() => " (refused)",
            Status::Refused | Status::NotShown => "",
        };
        table.add_row([
            format!("{}{verdict}", c.id),
            format!("{:.1}", c.evidence),
            format!("{:.1}", c.threshold),
            estimate(c),
            c.channels.join(" "),
            c.minimum_detectable.map_or("–".into(), |x| format!("from {}", number(x))),
        ]);
    }
    terminal::whole_names(table)
}

fn estimate(c: &Candidate) -> String {
    let of = |p: &crate::sysid::diagnose::Parameter| {
        let half = 0.5 * (p.ci95[1] - p.ci95[0]);
        let text = format!("{} {} ± {} {}", p.name, number(p.value), number(half), p.unit);
        text.trim().to_owned()
    };
    c.parameters.iter().map(of).collect::<Vec<_>>().join(", ")
}

fn channels(diagnosis: &Diagnosis) -> Table {
    let mut table = table([
        "channel",
        "unexplained, tuned by equation error",
        "with the effects",
        "goes with",
        "worst regime",
    ]);
    for column in table.column_iter_mut().skip(1).take(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    for c in &diagnosis.channels {
        table.add_row([
            c.channel.clone(),
            share(c.tuned_unexplained_fraction),
            share(c.unexplained_fraction),
            c.left_with.clone().unwrap_or("–".into()),
            c.worst_regime.clone().unwrap_or("–".into()),
        ]);
    }
    table
}

/// Formats the fraction `x` in percent; a dash if `x` is not finite.
fn share(x: f64) -> String {
    if x.is_finite() { format!("{:.3} %", 100.0 * x) } else { "–".into() }
}

/// Table of the constants that were estimated for each flight separately; `None` if there are none. Angles are in degrees.
fn own(diagnosis: &Diagnosis) -> Option<Table> {
    let angles = diagnosis.measurement.iter().filter(|m| m.id == askew::ID).map(|m| {
        let [value, sd] = [m.value, m.sd].map(f64::to_degrees);
        let estimate = format!("{} ± {} °", number(value), number(NORMAL_95 * sd));
        [m.flight.clone(), m.name.clone(), estimate, "–".into(), clear(m.asserted)]
    });
    let trims = diagnosis.trims.iter().map(|t| {
        let estimate =
            |[value, sd]: [f64; 2]| format!("{} ± {}", number(value), number(NORMAL_95 * sd));
        let beside = t.beside_mean.map_or("–".into(), estimate);
        let own = estimate([t.value, t.sd]);
        [t.flight.clone(), t.name.clone(), own, beside, clear(t.asserted)]
    });
    let rows: Vec<_> = angles.chain(trims).collect();
    let mut table =
        table(["flight", "constant", "estimate ± 95 %", "less the flights' mean", "asserted"]);
    table.add_rows(&rows);
    (!rows.is_empty()).then_some(table)
}

fn clear(asserted: bool) -> String {
    if asserted { "yes" } else { "" }.into()
}

/// Formats `x` with three significant figures; a dash if `x` is not finite.
fn number(x: f64) -> String {
    match x {
        x if !x.is_finite() => "–".into(),
        0.0 => "0".into(),
        x => {
            let places = (2 - x.abs().log10().floor() as i32).clamp(0, 6) as usize;
            format!("{x:.places$}")
        }
    }
}

#[cfg(all(test, feature = "demo"))]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_share_is_a_dash() {
        assert_eq!([0.012_34, f64::NAN].map(share), ["1.234 %", "–"]);
    }
}
