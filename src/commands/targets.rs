//! `greylag targets`: writes a target file, a random set of commanded attitudes (roll and pitch) for evaluations.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;

use crate::commands::files;
use crate::sim::TargetFile;

/// Options of `greylag targets`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Seed of the random targets; 1 gives the targets of the shipped file.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The file to write.
    #[arg(long)]
    out: PathBuf,
    /// Replace the file if it exists.
    #[arg(long)]
    force: bool,
}

/// Generates the targets and writes their file.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let targets = TargetFile::generate(arguments.seed);
    files::write(&arguments.out, &targets.to_csv(), arguments.force.into())?;
    println!(
        "{} targets of seed {} in {}",
        targets.rows.len(),
        arguments.seed,
        arguments.out.display()
    );
    Ok(ExitCode::SUCCESS)
}
