//! A CSV log that another program is still writing: rows as they come.

use std::path::Path;

use super::csv::{self, CsvError};
use super::flight::Sample;
use super::mapping::Mapping;

/// Buffer of a growing log for bytes that do not yet form a whole row.
#[derive(Clone, Debug, Default)]
pub struct Growing {
    /// The first line with its end; empty as long as it is not whole.
    header: Vec<u8>,
    rest: Vec<u8>,
}

impl Growing {
    /// Takes the `bytes` that were added; the rows that are whole now and have a time, in the units of the format.
    /// `path` is what errors call the log.
    ///
    /// # Errors
    /// The text is no table.
    pub fn take(&mut self, bytes: &[u8], path: &Path) -> Result<Vec<Sample>, CsvError> {
        self.rest.extend_from_slice(bytes);
        let Some(end) = self.rest.iter().rposition(|b| *b == b'\n').map(|at| at + 1) else {
            return Ok(Vec::new());
        };
        let kept = self.rest.split_off(end);
        let mut whole = std::mem::replace(&mut self.rest, kept);
        if self.header.is_empty() {
            let first = whole.iter().position(|b| *b == b'\n').map_or(0, |at| at + 1);
            let rows = whole.split_off(first);
            self.header = std::mem::replace(&mut whole, rows);
        }
        let table = [&self.header[..], &whole].concat();
        Ok(csv::raw(&table, path, &Mapping::default())?.rows)
    }
}
