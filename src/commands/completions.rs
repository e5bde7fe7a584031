//! `greylag completions`: what a shell needs to complete a command line.

use std::process::ExitCode;

use anyhow::Result;
use clap_complete::Shell;

/// Options of `greylag completions`.
#[derive(clap::Args)]
#[command(
    after_help = "For bash: greylag completions bash > ~/.local/share/bash-completion/completions/greylag"
)]
pub struct Arguments {
    /// The shell.
    shell: Shell,
}

/// Writes the completions of `command`.
pub fn run(arguments: &Arguments, command: &mut clap::Command) -> Result<ExitCode> {
    clap_complete::generate(arguments.shell, command, "greylag", &mut std::io::stdout());
    Ok(ExitCode::SUCCESS)
}
