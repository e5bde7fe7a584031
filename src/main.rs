//! Entry point of the program `greylag`.

use std::process::ExitCode;

fn main() -> ExitCode {
    greylag::commands::main()
}
