//! The program `greylag`.

use std::process::ExitCode;

fn main() -> ExitCode {
    greylag::commands::main()
}
