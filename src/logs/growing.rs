//! Reads a CSV log while another program is still writing it.

use std::path::Path;

use super::csv::{self, CsvError};
use super::flight::Sample;
use super::mapping::Mapping;

/// Buffer for the bytes of an incomplete last row of a growing log.
#[derive(Clone, Debug, Default)]
pub struct Growing {
    /// The header line with its line end; empty until it is complete.
    header: Vec<u8>,
    rest: Vec<u8>,
}

impl Growing {
    /// Adds `bytes`. Returns the newly completed rows that have a time stamp, in SI units. `path` appears in errors.
    ///
    /// # Errors
    /// The text is not a table.
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
