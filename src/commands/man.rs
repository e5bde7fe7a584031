//! `greylag man`: writes the manual pages.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};

/// Options of `greylag man`.
#[derive(clap::Args)]
#[command(
    after_help = "For one user: greylag man ~/.local/share/man/man1; then: man greylag-compare"
)]
pub struct Arguments {
    /// Folder for greylag.1, a page for every subcommand and greylag-sitl.1; created if missing.
    /// Pages in it are replaced.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

/// Writes the manual pages of `command` and, with the feature `demo`, of the simulator.
///
/// # Errors
/// If the folder cannot be written.
pub fn run(arguments: &Arguments, command: clap::Command) -> Result<ExitCode> {
    let folder = &arguments.folder;
    let context = || format!("cannot write manual pages into {}", folder.display());
    std::fs::create_dir_all(folder).with_context(context)?;
    clap_mangen::generate_to(command, folder).with_context(context)?;
    #[cfg(feature = "demo")]
    clap_mangen::generate_to(
        <greylag_sitl::arguments::Cli as clap::CommandFactory>::command(),
        folder,
    )
    .with_context(context)?;
    println!("manual pages in {}", folder.display());
    Ok(ExitCode::SUCCESS)
}
