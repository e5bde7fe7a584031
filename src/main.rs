//! The program `greylag`: reads its arguments, does what its subcommand says.

use std::process::ExitCode;

fn main() -> ExitCode {
    greylag::commands::main()
}
