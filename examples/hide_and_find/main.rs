//! Benchmark of the diagnosis of missing effects, with the results as a table.
//!
//! Every test case hides effects inside JSBSim, flies, and adds sensor errors to the logs. The program then diagnoses which
//! effects are missing from a model whose coefficients have errors of 15 %. Each case appends one line of JSON to the
//! results. A campaign can therefore be interrupted and resumed:
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl \
//!     --example hide_and_find -- --results target/hide-and-find.jsonl
//! ```
//!
//! The cases without hidden effects (nulls) come first. The minimum detectable amplitude of each effect is the median over
//! them.

mod ask;
mod cases;
mod export;
mod held_out;
mod record;
mod search;
mod table;

use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::{Parser, ValueEnum};
use rayon::prelude::*;

use cases::{Case, Seen};
use greylag::sim::missing::Craft;
use record::Record;
use search::Bench;

/// Number of cases that determine the minimum detectable amplitude of `drag_beta2`.
const PROBES: u64 = 8;

/// Hides effects in JSBSim, diagnoses them, and prints a table of the results.
#[derive(Parser)]
struct Arguments {
    /// Part of the campaign to run.
    #[arg(long, value_enum, default_value = "all")]
    part: Part,
    /// Seeds of the cases, as FIRST..LAST (the last one not included).
    #[arg(long, value_parser = seeds, default_value = "1000..1005")]
    seeds: (u64, u64),
    /// Number of cases without a hidden effect (nulls).
    #[arg(long, default_value_t = 100)]
    nulls: u64,
    /// Seed of the first null and of the first probe.
    #[arg(long, default_value_t = 0)]
    null_seed: u64,
    /// Amplitudes of single effects, as multiples of the minimum detectable amplitude.
    #[arg(long, num_args = 1.., default_values_t = cases::FACTORS)]
    factors: Vec<f64>,
    /// Number of surrogate data sets without an effect in each diagnosis, instead of the default.
    #[arg(long)]
    simulated_nulls: Option<usize>,
    /// Model file that matches the simulator's aircraft.
    #[arg(long, default_value = "params/x8/jsbsim.toml")]
    model: PathBuf,
    /// Name of the simulator's built-in aircraft.
    #[arg(long, default_value = "x8")]
    aircraft: String,
    /// Ids of the effects to hide; all effects without this option.
    #[arg(long, num_args = 1..)]
    effects: Vec<String>,
    /// File with the results, one line of JSON per case. Cases in this file are not repeated.
    #[arg(long, default_value = "target/hide-and-find.jsonl")]
    results: PathBuf,
    /// Only diagnose: without fits and errors on held-out flights.
    #[arg(long)]
    diagnose_only: bool,
    /// Only print the table of the results in the file.
    #[arg(long)]
    table: bool,
    /// Also write the regression of each case as CSV into this folder, for other methods.
    #[arg(long)]
    export: Option<PathBuf>,
    /// Only write the regressions, without a diagnosis.
    #[arg(long, requires = "export")]
    export_only: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Part {
    Nulls,
    /// Cases without a hidden effect, with one instrument installed or calibrated wrongly.
    Installed,
    Probes,
    Effects,
    Without,
    Pairs,
    All,
}

fn seeds(text: &str) -> Result<(u64, u64), String> {
    let (first, last) = text.split_once("..").ok_or("write FIRST..LAST")?;
    let number = |x: &str| x.trim().parse::<u64>().map_err(|e| e.to_string());
    let (first, last) = (number(first)?, number(last)?);
    if first < last {
        Ok((first, last))
    } else {
        Err("the first seed must come before the last".into())
    }
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    if let Some(folder) = &arguments.export {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("creating {}", folder.display()))?;
    }
    if !arguments.table {
        let mut bench =
            Bench::new(&arguments.model, &arguments.aircraft, arguments.simulated_nulls)?;
        bench.diagnose_only = arguments.diagnose_only;
        // the amplitudes of the second group depend on the minimum detectable amplitudes of the first
        for parts in [
            [Part::Nulls, Part::Installed, Part::Probes].as_slice(),
            &[Part::Effects, Part::Without, Part::Pairs],
        ] {
            let done = record::load(&arguments.results)?;
            let seen = Seen::of(&done, bench.craft());
            let mut cases: Vec<Case> =
                parts.iter().flat_map(|p| list(&arguments, *p, &seen, bench.craft())).collect();
            cases.retain(|case| arguments.export_only || done.iter().all(|d| d.key != case.key()));
            run(&arguments, &bench, &cases)?;
        }
    }
    print!("{}", table::render(&record::load(&arguments.results)?));
    Ok(())
}

/// The cases of a part of the campaign; none if the arguments do not select this part.
fn list(arguments: &Arguments, part: Part, seen: &Seen, craft: &Craft) -> Vec<Case> {
    // probes are run whenever nulls are
    let asked = if part == Part::Probes { Part::Nulls } else { part };
    if arguments.part != asked && arguments.part != Part::All {
        return Vec::new();
    }
    let wanted =
        |id: &str| arguments.effects.is_empty() || arguments.effects.iter().any(|e| e == id);
    let (seeds, first) = (arguments.seeds.0..arguments.seeds.1, arguments.null_seed);
    match part {
        // the seeds of nulls differ from those of all other parts
        Part::Nulls => cases::nulls(craft, first..first + arguments.nulls),
        Part::Installed => cases::installed(first..first + arguments.nulls),
        Part::Probes => cases::probes(craft, first..first + PROBES),
        Part::Effects => cases::effects(seeds, &arguments.factors, seen, wanted),
        Part::Without => cases::without(seeds, seen, wanted),
        Part::Pairs => cases::pairs(seeds, seen, wanted),
        Part::All => Vec::new(),
    }
}

/// Runs `cases` on all cores and appends each result to the results file when it is ready.
fn run(arguments: &Arguments, bench: &Bench, cases: &[Case]) -> Result<()> {
    if cases.is_empty() {
        return Ok(());
    }
    let out = OpenOptions::new().create(true).append(true).open(&arguments.results);
    let out = Mutex::new(out.with_context(|| format!("opening {}", arguments.results.display()))?);
    let (begun, count) = (Instant::now(), std::sync::atomic::AtomicUsize::new(0));
    cases.par_iter().try_for_each(|case| -> Result<()> {
        let trial = bench.fly(case);
        if let (Some(folder), Ok(trial)) = (&arguments.export, &trial) {
            export::write(folder, case, trial)?;
        }
        if !arguments.export_only {
            let record =
                trial.map_or_else(|why| Record::failed(case, &why), |t| bench.search(case, &t));
            let line = serde_json::to_string(&record)? + "\n";
            let Ok(mut out) = out.lock() else { bail!("another case has died") };
            out.write_all(line.as_bytes()).context("appending to the results")?;
        }
        let done = 1 + count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let seconds = begun.elapsed().as_secs_f64();
        eprintln!(
            "{done} of {} ({:.1} s a case): {}",
            cases.len(),
            seconds / done as f64,
            case.key()
        );
        Ok(())
    })
}
