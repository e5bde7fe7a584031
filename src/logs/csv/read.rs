//! Reading a CSV flight log: what is needed, what is dropped, what is refused.

use std::io::Read;
use std::path::Path;

use super::{COLUMNS, CsvError, Place};
use crate::logs::{Flight, Sample};

/// Columns without which a file is no flight log.
const NEEDED: [&str; 7] =
    ["time_s", "roll_rad", "pitch_rad", "p_radps", "q_radps", "r_radps", "airspeed_mps"];
/// For each actuator the command or the position must be there.
const EITHER: [(&str, &str); 3] = [
    ("aileron_cmd", "aileron_rad"),
    ("elevator_cmd", "elevator_rad"),
    ("throttle_cmd", "throttle"),
];
/// Share of unusable rows above which a log is refused.
const REFUSED_SHARE: f64 = 0.05;
/// Row numbers kept in the report of unusable rows.
const ROWS_NAMED: usize = 20;

/// Whether a log with many unusable rows is read all the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tolerance {
    /// More than 5 % of unusable rows refuse the log.
    Strict,
    /// Unusable rows are dropped, however many.
    Lenient,
}

/// A flight read from a file, with what was odd about it.
#[derive(Clone, Debug, Default)]
pub struct Reading {
    /// The flight.
    pub flight: Flight,
    /// Columns that the format does not name.
    pub unknown_columns: Vec<String>,
    /// Rows dropped as out of order, repeated, non-finite where needed, or impossible.
    pub dropped: usize,
    /// The numbers of the first of them, the header being row 1.
    pub dropped_rows: Vec<usize>,
    /// Whether the file ends in the middle of a row, which is left out.
    pub cut_short: bool,
}

/// Reads a flight log from a file.
///
/// # Errors
/// The file cannot be read, a needed column is missing, or too many rows are unusable.
pub fn load(path: &Path, tolerance: Tolerance) -> Result<Reading, CsvError> {
    let fail = |source| CsvError::File { doing: "read", path: path.to_owned(), source };
    let mut bytes = Vec::new();
    std::fs::File::open(path).map_err(fail)?.read_to_end(&mut bytes).map_err(fail)?;
    parse(&bytes, path, tolerance)
}

/// Reads a flight log from bytes; `path` is what errors call it.
///
/// # Errors
/// As [`load`].
pub fn parse(bytes: &[u8], path: &Path, tolerance: Tolerance) -> Result<Reading, CsvError> {
    let text = |source| CsvError::Text { path: path.to_owned(), source };
    // A row without its line end may miss digits: it is left out.
    let end = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let mut reader = ::csv::ReaderBuilder::new().flexible(true).from_reader(&bytes[..end]);
    let header = reader.byte_headers().map_err(text)?.clone();
    let names: Vec<String> =
        header.iter().map(|h| String::from_utf8_lossy(h).trim().to_owned()).collect();
    check_columns(&names, path)?;
    let places: Vec<Option<Place>> =
        names.iter().map(|name| COLUMNS.iter().find(|c| c.0 == name).map(|c| c.2)).collect();
    let mut reading = Reading { cut_short: end < bytes.len(), ..Reading::default() };
    reading.unknown_columns = names
        .iter()
        .zip(&places)
        .filter(|(_, place)| place.is_none())
        .map(|(name, _)| name.clone())
        .collect();
    let mut rows = 0;
    for (i, record) in reader.byte_records().enumerate() {
        let record = record.map_err(text)?;
        rows += 1;
        match sample(&record, &places).filter(|s| usable(s, reading.flight.samples.last())) {
            Some(sample) => reading.flight.samples.push(sample),
            None => {
                reading.dropped += 1;
                if reading.dropped_rows.len() < ROWS_NAMED {
                    reading.dropped_rows.push(i + 2);
                }
            }
        }
    }
    refuse_if_poor(&reading, rows, path, tolerance)?;
    Ok(reading)
}

fn check_columns(names: &[String], path: &Path) -> Result<(), CsvError> {
    let has = |column: &str| names.iter().any(|n| n == column);
    let missing = |column, remedy| CsvError::Column { path: path.to_owned(), column, remedy };
    for column in NEEDED {
        if !has(column) {
            return Err(missing(column, "add it, in the unit its name ends with".into()));
        }
    }
    for (command, position) in EITHER {
        if !has(command) && !has(position) {
            return Err(missing(command, format!("add it, or the position `{position}`")));
        }
    }
    Ok(())
}

/// The sample of a record; `None` when a field is no number.
fn sample(record: &::csv::ByteRecord, places: &[Option<Place>]) -> Option<Sample> {
    let mut sample = Sample::default();
    for (field, place) in record.iter().zip(places) {
        let Some(place) = place else { continue };
        let field = std::str::from_utf8(field).ok()?.trim();
        if !field.is_empty() {
            *place(&mut sample) = field.parse().ok()?;
        }
    }
    Some(sample)
}

/// Whether a sample is later than the last one, has what is needed, and is possible.
fn usable(s: &Sample, last: Option<&Sample>) -> bool {
    let needed = [s.time_s, s.attitude_rad[0], s.attitude_rad[1], s.airspeed_mps];
    let pi = std::f64::consts::PI + 1e-6;
    needed.iter().chain(&s.rates_radps).all(|x| x.is_finite())
        && COLUMNS.iter().all(|c| !c.1(s).is_infinite())
        && s.attitude_rad[0].abs() <= pi
        && s.attitude_rad[1].abs() <= pi / 2.0
        && s.airspeed_mps >= 0.0
        && last.is_none_or(|last| s.time_s > last.time_s)
}

fn refuse_if_poor(
    reading: &Reading,
    rows: usize,
    path: &Path,
    tolerance: Tolerance,
) -> Result<(), CsvError> {
    let poor = reading.dropped as f64 > REFUSED_SHARE * rows as f64;
    match (tolerance, reading.dropped_rows.first()) {
        (Tolerance::Strict, Some(&first)) if poor => {
            Err(CsvError::Unusable { path: path.to_owned(), dropped: reading.dropped, rows, first })
        }
        _ => Ok(()),
    }
}
