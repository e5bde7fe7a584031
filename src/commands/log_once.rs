//! Prints each warning on standard error only once, because every worker that loads an aircraft issues the same warnings.

use std::collections::BTreeSet;
use std::io::{self, Write};
use std::sync::Mutex;

/// Lines already printed.
static PRINTED: Mutex<BTreeSet<Vec<u8>>> = Mutex::new(BTreeSet::new());
/// Largest number of stored lines. Further lines are printed each time.
const REMEMBERED: usize = 1000;

/// A writer to standard error that omits repeated lines.
pub struct LogOnce;

impl Write for LogOnce {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        if is_new(line) {
            // A closed standard error is ignored: the logger would report this error with `eprintln!`, which panics
            // there and ends the thread that warns.
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
