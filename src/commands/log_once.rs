//! Prints each warning on standard error only once, because every thread that loads an aircraft issues the same warnings.

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::sync::Mutex;

/// The lines that were printed, so that a repeated line is recognised.
static PRINTED: Mutex<BTreeSet<Vec<u8>>> = Mutex::new(BTreeSet::new());
/// Largest number of stored lines. After that, every line is printed, including repeated ones.
const REMEMBERED: usize = 1000;

/// A writer to standard error that omits repeated lines.
pub struct LogOnce;

impl Write for LogOnce {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        if is_new(line) {
            // An error of this write is ignored. Standard error may be closed, and then the logger would report the error
            // with `eprintln!`. That would panic and end the thread that issued the warning.
            let _ = io::stderr().write_all(line);
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

fn is_new(line: &[u8]) -> bool {
    let Ok(mut printed) = PRINTED.lock() else { return true };
    printed.len() >= REMEMBERED || printed.insert(line.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_new_once() {
        assert!(is_new(b"WARN one of this test"));
        assert!(!is_new(b"WARN one of this test"));
        assert!(is_new(b"WARN another of this test"));
    }
}
