//! `greylag compare`: compares models with flight logs.
//!
//! A free run is an open-loop simulation: it starts at a measured state and uses the recorded deflections.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use comfy_table::Table;

use crate::commands::bar::Bar;
use crate::commands::distinct::distinct;
use crate::commands::files;
use crate::commands::given;
use crate::commands::intake::{Intake, LogArguments};
use crate::commands::outputs;
use crate::commands::predictions;
use crate::commands::status::IN_DOUBT;
use crate::commands::terminal::{Tone, noted, painted, print_answer, print_summary, table};
use crate::logs::quoted;
use crate::model::GreyBox;
use crate::report::ComparisonReport;
#[cfg(feature = "study")]
use crate::sysid::amend::{Origin, document::STORY};
use crate::sysid::compare::answer::multiple;
use crate::sysid::compare::{
    Answer, Comparison, HorizonScore, ModelResult, Options, compare, compare_and_drop,
};
use crate::sysid::flight_path::ActuatorClock;
use crate::sysid::flight_path::reconstruction::Reconstruction;

/// Letters that identify the models in the tables: A to Z, then AA to ZZ, and so on without an end.
fn letters() -> impl Iterator<Item = String> {
    (1usize..).map(|place| {
        let (mut letters, mut left) = (Vec::new(), place);
        while left > 0 {
            letters.push(char::from(b'A' + ((left - 1) % 26) as u8));
            left = (left - 1) / 26;
        }
        letters.into_iter().rev().collect::<String>()
    })
}

/// Options of `greylag compare`.
#[derive(clap::Args)]
#[command(
    after_help = "Exit status: 0 done, 1 nothing could be compared, 3 done, but a log was left out or holds what makes the figures wrong."
)]
pub struct Arguments {
    /// Model files, compared side by side; the first one leads the report.
    #[arg(long = "model", num_args = 1.., required = true, env = "GREYLAG_MODEL", hide_env_values = true)]
    models: Vec<PathBuf>,
    #[command(flatten)]
    logs: LogArguments,
    /// Horizons of the free runs (open-loop simulations from measured states), s.
    #[arg(long = "horizon", value_delimiter = ',', default_values_t = [1.0, 2.0, 5.0, 10.0])]
    horizons: Vec<f64>,
    /// Write all results as JSON; `-` for standard output, with nothing else on it.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write the report as one HTML page.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Write every free run as CSV: model, flight, start, horizon, each state predicted and measured, and the 95 % interval
    /// of the prediction from the errors of the other runs.
    #[arg(long, value_name = "CSV")]
    predictions: Option<PathBuf>,
    /// Use the deflections at the times that the log states for them, as `diagnose` and `amend` do. Without this
    /// option, a significant delay of the log's actuator clock is corrected, unless a model has an effect that explains it, such
    /// as a lag.
    #[arg(long)]
    recorded_clock: bool,
    /// Seed of the bootstrap intervals.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Replace output files that already exist.
    #[arg(long)]
    force: bool,
}

/// Reads and reconstructs the flights and compares the models with them. Prints the results, and writes the JSON, the CSV and
/// the report.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let overwrite = arguments.force.into();
    let written = [&arguments.json, &arguments.report, &arguments.predictions];
    outputs::check(written.into_iter().flatten(), inputs(arguments), overwrite)?;
    let models =
        arguments.models.iter().map(|path| given::model(path)).collect::<Result<Vec<_>>>()?;
    let clock = match arguments.recorded_clock {
        true => ActuatorClock::AsRecorded,
        false => {
            let effects = models.iter().flat_map(GreyBox::effects);
            ActuatorClock::beside(effects.map(|about| about.id))
        }
    };
    distinct(&arguments.logs.paths, &[])?;
    let Intake { flights, mut notes, mut in_doubt, used, .. } =
        arguments.logs.take_in(&models[0], clock)?;
    let bar = Bar::new();
    let (mut comparison, flights) = compared(arguments, &models, flights, &bar)?;
    bar.go_on()?;
    drop(bar);
    in_doubt |= comparison.flights.len() < arguments.logs.paths.len();
    in_doubt |= !comparison.doubtful.is_empty();
    notes.append(&mut comparison.notes);
    comparison.notes = notes;
    let used = arguments.logs.among(&used);
    comparison.answer = answer(arguments, &models, &flights, &comparison, &used)?;
    if !files::is_stdout(arguments.json.as_deref()) {
        print(&comparison);
    }
    if let Some(path) = &arguments.json {
        let text = serde_json::to_string_pretty(&comparison.document())? + "\n";
        files::write(path, &text, overwrite)?;
    }
    if let Some(path) = &arguments.predictions {
        let table = predictions::table(&models, &flights, &arguments.horizons)?;
        files::write(path, &table, overwrite)?;
    }
    if let Some(path) = &arguments.report {
        files::write(path, &page(arguments, &comparison), overwrite)?;
    }
    Ok(if in_doubt { ExitCode::from(IN_DOUBT) } else { ExitCode::SUCCESS })
}

/// The files that the command reads.
fn inputs(arguments: &Arguments) -> Vec<PathBuf> {
    let models = arguments.models.iter().flat_map(|path| given::files(path));
    models.chain(arguments.logs.files().cloned()).chain(story(arguments)).collect()
}

/// The result of the amendment beside the second of two models, if there is one.
#[cfg(feature = "study")]
fn story(arguments: &Arguments) -> Option<PathBuf> {
    let [_, after] = &arguments.models[..] else { return None };
    Some(files::shipped(after).with_file_name(STORY)).filter(|path| path.exists())
}

/// `None`: a build without the feature `study` cannot read the files of an amendment.
#[cfg(not(feature = "study"))]
fn story(_: &Arguments) -> Option<PathBuf> {
    None
}

/// The comparison of `models` with `flights`, and the flights if they are needed after it.
fn compared(
    arguments: &Arguments,
    models: &[GreyBox],
    flights: Vec<Reconstruction>,
    bar: &Bar,
) -> Result<(Comparison, Vec<Reconstruction>)> {
    let options = Options { horizons_s: arguments.horizons.clone(), seed: arguments.seed };
    if arguments.predictions.is_some() || origin(arguments, models).is_some() {
        let found = compare(models, &flights, &options, &|stage| bar.update(stage))?;
        return Ok((found, flights));
    }
    let found = compare_and_drop(models, flights, &options, &|stage| bar.update(stage))?;
    Ok((found, Vec::new()))
}

/// The origin of the second of two models, if it was amended from the first.
#[cfg(feature = "study")]
fn origin(arguments: &Arguments, models: &[GreyBox]) -> Option<Origin> {
    let ([before, _], [_, after]) = (models, &arguments.models[..]) else { return None };
    Origin::beside(&files::shipped(after), before)
}

/// `None`: a build without the feature `study` cannot read the files of an amendment.
#[cfg(not(feature = "study"))]
fn origin(_: &Arguments, _: &[GreyBox]) -> Option<()> {
    None
}

/// The summary for a model and its refit by `greylag amend` (an amendment). It separates the change of the error by re-estimated
/// coefficients from the change by added effects (physical contributions to forces and moments). `None` unless there are two
/// models and the second was amended from the first.
#[cfg(feature = "study")]
fn traced(
    arguments: &Arguments,
    models: &[GreyBox],
    flights: &[Reconstruction],
    comparison: &Comparison,
) -> Result<Option<Answer>> {
    let Some((origin, before)) = origin(arguments, models).zip(models.first()) else {
        return Ok(None);
    };
    let tuned = origin.tuned(before).unwrap_or_else(|| before.clone());
    let errors = crate::sysid::compare::scores(&tuned, flights, &arguments.horizons)?;
    let shares = crate::sysid::compare::shares(&tuned, flights).ok();
    Ok(Some(origin.answer(comparison, (&errors[..], shares), &arguments.logs.paths)))
}

/// `None`: a build without the feature `study` cannot read the files of an amendment.
#[cfg(not(feature = "study"))]
fn traced(
    _: &Arguments,
    _: &[GreyBox],
    _: &[Reconstruction],
    _: &Comparison,
) -> Result<Option<Answer>> {
    Ok(None)
}

/// The summary with the command to run next. For a model and its amendment it is the summary of `traced`. If an estimate is
/// physically impossible, the logs are inspected next, and nothing is said about channels. `used` are the logs that were compared.
fn answer(
    arguments: &Arguments,
    models: &[GreyBox],
    flights: &[Reconstruction],
    comparison: &Comparison,
    used: &LogArguments,
) -> Result<Answer> {
    let file = arguments.models.last().map_or(Path::new(""), PathBuf::as_path);
    if !comparison.doubtful.is_empty() {
        return Ok(comparison.answer.clone().then(used.inspected(file)));
    }
    let traced = traced(arguments, models, flights, comparison)?;
    let last = quoted(file);
    Ok(traced.unwrap_or_else(|| comparison.answer.clone()).then(match models.len() {
        1 => format!("greylag diagnose --model {last}{}", used.words()),
        _ => format!("greylag aircraft check --model {last}"),
    }))
}

/// The report as HTML.
fn page(arguments: &Arguments, comparison: &Comparison) -> String {
    let paths = |all: &[PathBuf]| all.iter().map(|p| p.display().to_string()).collect();
    let report = ComparisonReport {
        title: "Models against flights".into(),
        comparison,
        model_files: paths(&arguments.models),
        log_files: paths(&arguments.logs.paths),
        command_line: files::command_line(),
        versions: vec![("greylag".into(), env!("CARGO_PKG_VERSION").into())],
    };
    report.page().render()
}

fn print(comparison: &Comparison) {
    let doubtful = &comparison.doubtful;
    doubtful.iter().for_each(|said| println!("{}", painted(said, Tone::Bad)));
    print_answer(&comparison.answer);
    for (model, letter) in comparison.models.iter().zip(letters()) {
        println!("{letter}  {}", model.name);
        let sentences = model.sentences_worst_first().into_iter();
        let own = sentences.filter(|said| doubtful.iter().all(|first| first != said));
        own.for_each(|sentence| println!("   {sentence}"));
        println!();
    }
    println!("{}", free_run_table(comparison));
    if doubtful.is_empty() {
        println!("{}", channel_table(&comparison.models));
    }
    baselines(comparison).into_iter().for_each(|line| println!("{line}"));
    for flight in &comparison.flights {
        flight.notes.iter().for_each(|note| println!("{}: {note}", flight.name));
    }
    comparison.notes.iter().for_each(|note| println!("{}", noted(note)));
    print_summary(&comparison.answer);
}

/// Errors of the baseline forecasts without aerodynamics (a held state, for example) at the horizon of the summary, in one
/// line. `None` if no forecast reaches that horizon.
fn baselines(comparison: &Comparison) -> Option<String> {
    let horizon = comparison.answer.numbers.horizon_s;
    let error = |f: &crate::sysid::compare::forecast::ForecastResult| {
        let at = f.free_run.iter().find(|s| s.horizon_s == horizon)?;
        Some(format!("{} {:.3}", f.name, at.rmse_scaled))
    };
    let all: Vec<String> = comparison.forecasts.iter().filter_map(error).collect();
    let said = format!("forecasts without aerodynamics at {horizon} s: {}", all.join("; "));
    (!all.is_empty()).then_some(said)
}

/// Errors of the free runs: NRMSE, and RMSE of each state in m/s, ° and °/s. If a model's file has constants of the flights
/// (trims, sensor errors), the table also has the errors without these constants.
fn free_run_table(comparison: &Comparison) -> Table {
    let header = [
        "", "s", "NRMSE", "lost", "roll °", "pitch °", "V m/s", "p °/s", "q °/s", "r °/s", "α °",
        "β °",
    ];
    let mut table = table(header, 1);
    for (model, letter) in comparison.models.iter().zip(letters()) {
        let without = model.known.as_ref().map_or(&[][..], |k| k.without.as_slice());
        let with = model.free_run.iter().map(|s| (letter.clone(), s));
        let all = with.chain(without.iter().map(|s| (format!("{letter} without"), s)));
        for (name, score) in all.filter(|(_, s)| s.runs > 0) {
            table.add_row(free_run_row(name, score));
        }
    }
    table
}

fn free_run_row(name: String, score: &HorizonScore) -> Vec<String> {
    let mut row = vec![
        name,
        format!("{}", score.horizon_s),
        format!("{:.5}", score.rmse_scaled),
        format!("{}/{}", score.diverged, score.runs),
    ];
    row.extend(score.states.iter().map(|s| {
        let angle = s.state != "airspeed_mps";
        number(if angle { s.rmse.to_degrees() } else { s.rmse })
    }));
    row
}

fn channel_table(models: &[ModelResult]) -> Table {
    let header = ["", "channel", "unexplained", "measured sd", "residual", "noise", "unit"];
    let mut table = table(header, 2);
    for (model, letter) in models.iter().zip(letters()) {
        for c in model.worst_first() {
            let share = match c.unexplained_fraction {
                share if share.is_nan() => "not excited".into(),
                share => multiple(share).unwrap_or_else(|| format!("{:.2} %", 100.0 * share)),
            };
            table.add_row([
                letter.clone(),
                format!("{} {}", c.channel.symbol(), c.name),
                share,
                number(c.measured_sd),
                number(c.residual_rms),
                number(c.noise_sd),
                c.unit.into(),
            ]);
        }
    }
    table
}

/// Formats `x` with three significant figures; a dash if `x` is not finite.
fn number(x: f64) -> String {
    match x {
        x if !x.is_finite() => "–".into(),
        x if x.abs() < 1e-4 => "0".into(),
        x => {
            let places = (2 - x.abs().log10().floor() as i32).clamp(0, 6) as usize;
            format!("{x:.places$}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_has_letters_of_its_own() {
        let all: Vec<String> = letters().take(1000).collect();
        let at = |places: [usize; 7]| places.map(|place| all[place].as_str());
        assert_eq!(at([0, 25, 26, 51, 52, 701, 702]), ["A", "Z", "AA", "AZ", "BA", "ZZ", "AAA"]);
        let distinct: std::collections::BTreeSet<&String> = all.iter().collect();
        assert_eq!(distinct.len(), 1000);
    }
}
