//! `greylag completions`: writes the completion script of a shell.

use std::process::ExitCode;

use anyhow::Result;
use clap_complete::Shell;

/// Options of `greylag completions`.
#[derive(clap::Args)]
#[command(
    after_help = "For bash: greylag completions bash > ~/.local/share/bash-completion/completions/greylag"
)]
pub struct Arguments {
    /// Shell to write completions for.
    shell: Shell,
}

/// Prints the script that completes the command line of `command` in the chosen shell.
pub fn run(arguments: &Arguments, command: &mut clap::Command) -> Result<ExitCode> {
    // the script is not generated into standard output directly, because the generator panics if the reader has closed it
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, command, "greylag", &mut script);
    print!("{}", String::from_utf8(script)?);
    Ok(ExitCode::SUCCESS)
}
