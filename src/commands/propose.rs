//! `greylag propose`: searches for a formula that describes those errors of a model that no effect of the catalogue explains. An
//! effect is a physical contribution to forces and moments. The catalogue has the effects that the program knows.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail};
use comfy_table::{CellAlignment, Table};

use crate::commands::bar::Bar;
use crate::commands::distinct::distinct;
use crate::commands::effect_files::{effect_paths, named_effects};
use crate::commands::files;
use crate::commands::given;
use crate::commands::intake::{Intake, LogArguments};
use crate::commands::outputs;
use crate::commands::status::IN_DOUBT;
use crate::commands::terminal::noted;
use crate::sysid::diagnose::{Options, Proposal, Rung, propose};
use crate::sysid::flight_path::ActuatorClock;

/// Options of `greylag propose`.
#[derive(clap::Args)]
#[command(
    after_help = "Exit status: 0 a formula is proposed, 1 the search could not be made, 3 none is proposed, or a log was left out or holds what makes the figures wrong: the output says which."
)]
pub struct Arguments {
    /// The model file of the aircraft.
    #[arg(long)]
    model: PathBuf,
    #[command(flatten)]
    logs: LogArguments,
    /// Logs that the search does not see, on which the formula is tested [default: the last log].
    #[arg(long, num_args = 1..)]
    hold_out: Vec<PathBuf>,
    /// Write the effect file, which `greylag amend --effect` takes.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write all results as JSON; `-` for standard output, with nothing else on it.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Effect files (TOML) or folders of them, tried as candidates in addition to the catalogue.
    #[arg(long = "effect", value_name = "FILE", num_args = 1..)]
    effects: Vec<String>,
    /// Ids of effects of the catalogue that are not tried as candidates.
    #[arg(long, num_args = 1..)]
    without: Vec<String>,
    /// Try only the function shapes of the built-in library; do not search for free formulas.
    #[arg(long)]
    library_only: bool,
    /// Number of bootstrap draws under the null hypothesis (no effect missing). They determine the thresholds.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u16).range(20..))]
    nulls: u16,
    /// Seed of all random draws.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Replace the files if they exist.
    #[arg(long)]
    force: bool,
}

/// Reads and reconstructs the flights and searches for a formula. Prints the result, and writes the effect file.
///
/// # Errors
/// If a file cannot be read or written, or the flights do not allow a search.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let overwrite = arguments.force.into();
    outputs::check(arguments.json.iter().chain(&arguments.out), inputs(arguments), overwrite)?;
    let model = given::model(&arguments.model)?;
    let with = named_effects(&arguments.effects)?;
    let (search, test) = divided(arguments)?;
    let clock = ActuatorClock::AsRecorded;
    let Intake { flights, mut notes, mut in_doubt, installation, .. } =
        arguments.logs.of(search).take_in(&model, clock)?;
    let tests = arguments.logs.of(test).take_in_as(&model, clock, &installation)?;
    in_doubt |= tests.in_doubt;
    notes.extend(tests.notes);
    let options = Options {
        seed: arguments.seed,
        nulls: arguments.nulls.into(),
        with,
        without: arguments.without.clone(),
        free_forms: !arguments.library_only,
        ..Options::default()
    };
    let bar = Bar::new();
    let mut proposal =
        propose(&model, &flights, &tests.flights, &options, &|stage| bar.update(stage))?;
    bar.go_on()?;
    drop(bar);
    notes.append(&mut proposal.notes);
    proposal.notes = notes;
    let quiet = files::is_stdout(arguments.json.as_deref());
    if !quiet {
        print(&proposal);
    }
    if let Some(path) = &arguments.json {
        files::write(path, &(serde_json::to_string_pretty(&proposal)? + "\n"), overwrite)?;
    }
    let Some(effect) = &proposal.effect else { return Ok(ExitCode::from(IN_DOUBT)) };
    match &arguments.out {
        Some(path) => {
            files::write(path, effect, overwrite)?;
            eprintln!("wrote {}; try it with `greylag amend --effect {0}`", path.display());
        }
        None if quiet => {}
        None => println!("\n{effect}"),
    }
    Ok(if in_doubt { ExitCode::from(IN_DOUBT) } else { ExitCode::SUCCESS })
}

/// The files that the command reads.
fn inputs(arguments: &Arguments) -> Vec<PathBuf> {
    let logs = arguments.logs.files().chain(&arguments.hold_out).cloned();
    given::files(&arguments.model)
        .into_iter()
        .chain(logs)
        .chain(effect_paths(&arguments.effects))
        .collect()
}

/// Divides the logs into logs for the search and logs for the test. If no log is held out by `--hold-out`, the last log is for
/// the test.
fn divided(arguments: &Arguments) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let (logs, held) = (&arguments.logs.paths, &arguments.hold_out);
    distinct(logs, held)?;
    match (&logs[..], &held[..]) {
        ([first @ .., last], []) if !first.is_empty() => Ok((first.to_vec(), vec![last.clone()])),
        ([only], []) => bail!(
            "{} is the only log: a formula is tested on flights that its search has not seen; name more with --log \
             or --hold-out",
            only.display()
        ),
        _ => Ok((logs.clone(), held.clone())),
    }
}

fn print(proposal: &Proposal) {
    println!("{}", proposal.model);
    proposal.sentences.iter().for_each(|sentence| println!("  {sentence}"));
    if !proposal.front.is_empty() {
        println!("\n{}", front(&proposal.front, "evidence of last term"));
    }
    if let Some(free) = proposal.free.as_ref().filter(|f| !f.front.is_empty()) {
        println!("\nfree forms, the best of each size\n{}", front(&free.front, "evidence"));
    }
    proposal.notes.iter().for_each(|note| println!("{}", noted(note)));
}

/// Table of the best formulas, one row for each size. `evidence` is the heading of the column with the evidence.
fn front(rungs: &[Rung], evidence: &str) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["formula", "size", "error removed", evidence, "by chance"]);
    table.column_iter_mut().skip(1).for_each(|c| c.set_cell_alignment(CellAlignment::Right));
    for rung in rungs {
        let mark = if rung.chosen { " (chosen)" } else { "" };
        table.add_row([
            format!("{}{mark}", rung.formula),
            rung.complexity.to_string(),
            format!("{:.1} %", 100.0 * rung.removed),
            format!("{:.1}", rung.evidence),
            format!("{:.1}", rung.threshold),
        ]);
    }
    table
}
