//! Printing to standard output and standard error.
//!
//! The macros replace those of the standard library in all commands. Those panic if the reader of the output has left, as in
//! `greylag … | head`, and the files that the command has yet to write would be lost.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::process;

use super::{mistake, terminal};

#[cfg(feature = "study")]
macro_rules! print {
    ($($words:tt)*) => { $crate::commands::console::to_stdout(format_args!($($words)*)) };
}

macro_rules! println {
    () => { $crate::commands::console::to_stdout(format_args!("\n")) };
    ($($words:tt)*) => { $crate::commands::console::line_to_stdout(format_args!($($words)*)) };
}

macro_rules! eprintln {
    ($($words:tt)*) => { $crate::commands::console::line_to_stderr(format_args!($($words)*)) };
}

/// Prints `text` to standard output. It does nothing if the reader has left. Any other error ends the program with one line on
/// standard error and status 1.
pub fn to_stdout(text: Arguments<'_>) {
    if let Err(error) = io::stdout().write_fmt(text)
        && error.kind() != ErrorKind::BrokenPipe
    {
        terminal::complain(format_args!("{}", mistake::no_output(&error.to_string())));
        process::exit(1);
    }
}

/// Prints a line to standard output, see [`to_stdout`].
pub fn line_to_stdout(line: Arguments<'_>) {
    to_stdout(format_args!("{line}\n"));
}

/// Prints a line to standard error. Errors are ignored, because there is no other place to report them.
pub fn line_to_stderr(line: Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{line}");
}
