//! A CSV log that another program is still writing: rows as they come.

use std::path::Path;

use super::csv::{self, CsvError};
use super::flight::Sample;
use super::mapping::Mapping;

/// What has come of a growing log but is no whole row yet.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logs::Flight;

    #[test]
    fn rows_come_whole_and_once_wherever_the_file_is_cut() {
        let sample =
            |k: u32| Sample { time_s: f64::from(k), airspeed_mps: 20.0, ..Default::default() };
        let flight = Flight { samples: (0..20).map(sample).collect(), ..Default::default() };
        let mut text = Vec::new();
        csv::write(&flight, &mut text).unwrap();
        for size in [1, 7, 100, text.len()] {
            let mut growing = Growing::default();
            let parts =
                text.chunks(size).map(|part| growing.take(part, Path::new("a.csv")).unwrap());
            let times: Vec<f64> = parts.flatten().map(|s| s.time_s).collect();
            assert_eq!(times, (0..20).map(f64::from).collect::<Vec<_>>(), "in parts of {size}");
        }
    }
}
