//! Hide and find: the benchmark of the search for missing effects, as a table.
//!
//! Every case hides effects inside JSBSim, flies, spoils the logs as real sensors do, and asks the
//! program what is missing from a model whose coefficients are wrong by 15 %. A line of JSON a case is
//! appended to the results, so that a campaign can be interrupted and taken up again:
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl \
//!     --example hide_and_find -- --results target/hide-and-find.jsonl
//! ```
//!
//! Nulls come first: how much of each effect could have been seen is the median over them.

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

/// Flights that are flown to see how much of an effect could be seen.
const PROBES: u64 = 8;

/// Hides effects in JSBSim, looks for them, and prints the table.
#[derive(Parser)]
struct Arguments {
    /// Part of the campaign to run.
    #[arg(long, value_enum, default_value = "all")]
    part: Part,
    /// Seeds of the cases, as FIRST..LAST (the last one not included).
    #[arg(long, value_parser = seeds, default_value = "1000..1005")]
    seeds: (u64, u64),
    /// Number of null flights.
    #[arg(long, default_value_t = 100)]
    nulls: u64,
    /// Seed of the first null flight and of the first probe flight.
    #[arg(long, default_value_t = 0)]
    null_seed: u64,
    /// Amplitudes of single effects, as multiples of the minimum detectable one.
    #[arg(long, num_args = 1.., default_values_t = cases::FACTORS)]
    factors: Vec<f64>,
    /// Nulls that each diagnosis simulates, in place of the usual number.
    #[arg(long)]
    simulated_nulls: Option<usize>,
    /// Model that flies as the simulator's aircraft does.
    #[arg(long, default_value = "params/x8/jsbsim.toml")]
    model: PathBuf,
    /// The simulator's aircraft, built in.
    #[arg(long, default_value = "x8")]
    aircraft: String,
    /// Only these effects, by their ids.
    #[arg(long, num_args = 1..)]
    effects: Vec<String>,
    /// One line of JSON a case; cases that are in it are not done again.
    #[arg(long, default_value = "target/hide-and-find.jsonl")]
    results: PathBuf,
    /// Only print the table of what is in the results.
    #[arg(long)]
    table: bool,
    /// Also write each case's regression (CSV) for other methods, into this folder.
    #[arg(long)]
    export: Option<PathBuf>,
    /// Write the regressions and search nothing.
    #[arg(long, requires = "export")]
    export_only: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Part {
    Nulls,
    /// Nulls whose instruments are installed or calibrated wrong.
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
        let bench = Bench::new(&arguments.model, &arguments.aircraft, arguments.simulated_nulls)?;
        // amplitudes of the other parts hang on what the nulls could have seen
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

/// The cases of a part of the campaign, if it is asked for.
fn list(arguments: &Arguments, part: Part, seen: &Seen, craft: &Craft) -> Vec<Case> {
    // probes go with nulls
    let asked = if part == Part::Probes { Part::Nulls } else { part };
    if arguments.part != asked && arguments.part != Part::All {
        return Vec::new();
    }
    let wanted =
        |id: &str| arguments.effects.is_empty() || arguments.effects.iter().any(|e| e == id);
    let (seeds, first) = (arguments.seeds.0..arguments.seeds.1, arguments.null_seed);
    match part {
        // the nulls' seeds are apart from all others
        Part::Nulls => cases::nulls(craft, first..first + arguments.nulls),
        Part::Installed => cases::installed(first..first + arguments.nulls),
        Part::Probes => cases::probes(craft, first..first + PROBES),
        Part::Effects => cases::effects(seeds, &arguments.factors, seen, wanted),
        Part::Without => cases::without(seeds, seen, wanted),
        Part::Pairs => cases::pairs(seeds, seen, wanted),
        Part::All => Vec::new(),
    }
}

/// Does `cases` on all cores, appending each result as it comes.
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
