//! `greylag campaign gather`: collects the results of a campaign and lists its cells without a result. A cell is one command
//! line of the campaign, for example one training with one seed.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};

use super::Which;
use crate::campaign::gather::{Gathered, Joined, gather, read_lines, write_lines};
use crate::commands::files::{self, Overwrite, shipped};
use crate::commands::outputs;
use crate::commands::status::IN_DOUBT;

/// Largest number of cells that are listed by name. Further cells are only counted.
const NAMED: usize = 20;

/// Options of `greylag campaign gather`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    which: Which,
    /// Write the results as JSON lines. Equal results give identical files.
    #[arg(long, value_name = "FILE.jsonl")]
    results: Option<PathBuf>,
    /// Write the duration, date and processor of each finished cell as JSON lines.
    #[arg(long, value_name = "FILE.jsonl")]
    times: Option<PathBuf>,
    /// Files that `--results` wrote on other machines. Their results are used for the cells that
    /// have no result here.
    #[arg(long, value_name = "FILE.jsonl", num_args = 1..)]
    join: Vec<PathBuf>,
    /// Replace the files if they exist.
    #[arg(long)]
    force: bool,
}

/// Collects the results and prints the cells that are not done.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let overwrite: Overwrite = arguments.force.into();
    for path in arguments.results.iter().chain(&arguments.times) {
        if files::is_stdout(Some(path)) {
            bail!("--results and --times name files; standard output holds the list of the cells");
        }
    }
    let inputs = arguments.join.iter().cloned().chain([shipped(&arguments.which.file)]);
    outputs::check(arguments.results.iter().chain(&arguments.times), inputs, overwrite)?;
    let (plan, store) = arguments.which.open()?;
    let mut all = gather(&plan, &store)?;
    println!(
        "{} of {} cells are done in {}",
        all.records.len(),
        plan.cells.len(),
        store.folder().display()
    );
    for path in &arguments.join {
        print_joined(path, &all.join(&plan, read_lines(path)?));
    }
    print_unfinished(&all);
    if let Some(path) = &arguments.results {
        write_lines(path, &all.records)?;
        println!("results in {}", path.display());
    }
    if let Some(path) = &arguments.times {
        write_lines(path, &all.times)?;
        println!("times in {}", path.display());
    }
    Ok(if all.is_whole() { ExitCode::SUCCESS } else { ExitCode::from(IN_DOUBT) })
}

/// Prints how many results of the file `path` were used, and why others were not.
fn print_joined(path: &Path, joined: &Joined) {
    let path = path.display();
    println!("{} results taken from {path}", joined.taken);
    if joined.twice > 0 {
        println!("{} cells were run here as well, with the same measurements", joined.twice);
    }
    for cell in &joined.differing {
        println!(
            "{cell} was run here as well and measured something else: the result from here stays"
        );
    }
    if joined.foreign > 0 {
        println!(
            "{} results in {path} belong to no cell of this campaign, or to another command or input: left out",
            joined.foreign
        );
    }
}

/// Prints the cells that are not done.
pub fn print_unfinished(all: &Gathered) {
    for (cell, failure) in &all.failed {
        println!("failed: {cell}: {}", failure.error);
    }
    for (what, cells) in [
        ("begun and not done", &all.begun),
        ("stale: its command or an input has changed since", &all.stale),
        ("missing", &all.missing),
    ] {
        for cell in cells.iter().take(NAMED) {
            println!("{what}: {cell}");
        }
        if cells.len() > NAMED {
            println!("{what}: {} more", cells.len() - NAMED);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_output_is_no_file_of_results() {
        let which = Which { file: "missing.toml".into(), out: None };
        let results = Some("-".into());
        let arguments = Arguments { which, results, times: None, join: Vec::new(), force: false };
        assert!(run(&arguments).unwrap_err().to_string().contains("--results"));
    }
}
