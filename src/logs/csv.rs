//! Flight logs as CSV tables: a header row, then one row for each sample, in SI units.

mod airspeed;
mod dialect;
mod head;
mod quaternion;
mod raw;
mod records;
mod thin;
mod write;

pub use super::rows::Tolerance;
pub(crate) use airspeed::make_true;
pub use quaternion::Order;
pub(crate) use raw::{Raw, raw, read};
pub use write::Rows;
pub use write::save;
pub use write::write;

use std::io::Read;
use std::path::{Path, PathBuf};

use super::mapping::Mapping;
use super::{Flight, rows};

/// Reason why a CSV flight log cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CsvError {
    /// The file cannot be opened, read or written.
    #[error("cannot {doing} flight log {path}: {source}: check the path and its permissions")]
    File {
        /// Operation that failed, such as `read`.
        doing: &'static str,
        /// Path of the log.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The text is not a CSV table.
    #[error("flight log {path}: {source}: correct the row or cut the file before it")]
    Text {
        /// Path of the log.
        path: PathBuf,
        /// Error of the CSV reader.
        source: ::csv::Error,
    },
    /// A required column is missing.
    #[error("flight log {path} has no column `{column}`: {remedy}")]
    Column {
        /// Path of the log.
        path: PathBuf,
        /// Name of the missing column.
        column: &'static str,
        /// Text that shows the user how to supply the column.
        remedy: String,
    },
    /// More than 5 % of the rows are unusable.
    #[error(
        "flight log {path}: {dropped} of {rows} rows are unusable ({reasons}; first: row {first}), above 5 %: repair it or read it leniently"
    )]
    Unusable {
        /// Path of the log.
        path: PathBuf,
        /// Number of rows that were dropped.
        dropped: usize,
        /// Number of rows that were read.
        rows: usize,
        /// Reasons for dropping, with counts.
        reasons: String,
        /// Number of the first dropped row. The header is row 1.
        first: usize,
    },
}

/// A flight read from a file, with the findings about the file.
#[derive(Clone, Debug, Default)]
pub struct Reading {
    /// The flight as read.
    pub flight: Flight,
    /// Columns of the file that the format does not name.
    pub unknown_columns: Vec<String>,
    /// Number of dropped rows: out of order, repeated, not finite in a required column, or physically impossible.
    pub dropped: usize,
    /// Numbers of the first dropped rows. The header is row 1.
    pub dropped_rows: Vec<usize>,
    /// Whether the file ends in the middle of a row; that row is not read.
    pub cut_short: bool,
}

/// Reads a flight log from a file.
///
/// # Errors
/// The file cannot be read, a required column is missing, or too many rows are unusable.
pub fn load(path: &Path, tolerance: Tolerance) -> Result<Reading, CsvError> {
    let fail = |source| CsvError::File { doing: "read", path: path.to_owned(), source };
    let mut bytes = Vec::new();
    std::fs::File::open(path).map_err(fail)?.read_to_end(&mut bytes).map_err(fail)?;
    parse(&bytes, path, tolerance)
}

/// Reads a flight log from bytes; `path` appears in errors.
///
/// # Errors
/// The same errors as those of [`load`].
pub fn parse(bytes: &[u8], path: &Path, tolerance: Tolerance) -> Result<Reading, CsvError> {
    let mut raw = raw(bytes, path, &Mapping::default())?;
    if !raw.missing.is_empty() {
        return Err(raw.missing.remove(0));
    }
    match settle(raw, path, tolerance) {
        (_, Some(error)) => Err(error),
        (reading, None) => Ok(reading),
    }
}

/// Returns the usable rows. If too many rows are unusable, also returns an error.
pub(super) fn settle(
    mut raw: Raw,
    path: &Path,
    tolerance: Tolerance,
) -> (Reading, Option<CsvError>) {
    let rows = raw.judged(|rows, number, row, kept| {
        rows.judged(number, row, kept.last().map(|last| last.time_s))
    });
    let error = rows.refused(tolerance).map(|first| CsvError::Unusable {
        path: path.to_owned(),
        dropped: rows.dropped,
        rows: rows.total,
        reasons: rows.reasons(),
        first,
    });
    (reading(raw, rows, path), error)
}

/// Keeps every row whose time is later than that of the last kept row, even if required values are missing. This serves
/// the inspection of incomplete tables.
pub(super) fn keep_all(mut raw: Raw, path: &Path) -> Reading {
    let rows = raw.judged(|rows, number, row, kept| {
        let last = kept.last().map(|last| last.time_s);
        match row {
            Some(row) => rows.later(number, row, last),
            None => rows.judged(number, None, last),
        }
    });
    reading(raw, rows, path)
}

fn reading(raw: Raw, rows: rows::Rows, path: &Path) -> Reading {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let unknown_columns = raw.unknown_columns;
    Reading {
        flight: Flight {
            name,
            samples: rows.samples,
            unknown_columns: unknown_columns.clone(),
            notes: Vec::new(),
            ..Flight::default()
        },
        unknown_columns,
        dropped: rows.dropped,
        dropped_rows: rows.dropped_rows,
        cut_short: raw.cut_short,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sample;
    use crate::columns::COLUMNS;

    fn flown(rows: usize) -> Flight {
        let sample = |i: usize| {
            let mut sample = Sample { time_s: i as f64 * 0.01, ..Sample::default() };
            // Each column gets its own number with many digits.
            for (k, column) in COLUMNS.iter().enumerate().skip(1) {
                *column.2(&mut sample) = ((i + k) as f64).sin().abs() / 3.0;
            }
            sample
        };
        (0..rows).map(sample).collect::<Vec<_>>().into()
    }

    fn text(flight: &Flight) -> Vec<u8> {
        let mut out = Vec::new();
        write(flight, &mut out).unwrap();
        out
    }

    fn read(bytes: &[u8]) -> Result<Reading, CsvError> {
        parse(bytes, Path::new("flight.csv"), Tolerance::Strict)
    }

    #[test]
    fn what_is_written_reads_back_to_the_bit() {
        let mut flight = flown(50);
        let reading = read(&text(&flight)).unwrap();
        assert_eq!(reading.flight.samples, flight.samples);
        assert_eq!((reading.dropped, reading.cut_short), (0, false));
        // A missing value is an empty field, which comes back as missing.
        flight.samples[3].alpha_rad = f64::NAN;
        let back = read(&text(&flight)).unwrap().flight.samples;
        assert!(back[3].alpha_rad.is_nan() && back[3].beta_rad == flight.samples[3].beta_rad);
    }

    #[test]
    fn a_file_cut_at_any_byte_is_read_up_to_the_last_whole_row() {
        let whole = text(&flown(3));
        let header = whole.iter().position(|b| *b == b'\n').unwrap() + 1;
        for end in header..whole.len() {
            let reading = read(&whole[..end]).unwrap();
            let rows = whole[header..end].iter().filter(|b| **b == b'\n').count();
            assert_eq!(reading.flight.samples.len(), rows);
        }
        for end in 0..header {
            assert!(matches!(read(&whole[..end]), Err(CsvError::Column { .. })), "{end}");
        }
    }

    #[test]
    fn bad_rows_are_dropped_by_number_and_refused_above_five_in_a_hundred() {
        let mut flight = flown(100);
        flight.samples[10].time_s = flight.samples[9].time_s;
        flight.samples[20].airspeed_mps = -20.0;
        flight.samples[30].attitude_rad[0] = 4.0;
        let reading = read(&text(&flight)).unwrap();
        // Row 1 is the header, so sample 10 is in row 12.
        assert_eq!(reading.dropped_rows, vec![12, 22, 32]);
        assert_eq!(reading.flight.samples.len(), 97);
        for i in 40..43 {
            flight.samples[i].rates_radps[1] = f64::NAN;
        }
        let error = read(&text(&flight)).unwrap_err().to_string();
        assert!(error.contains("6 of 100") && error.contains("row 12"), "{error}");
        let lenient = parse(&text(&flight), Path::new("flight.csv"), Tolerance::Lenient).unwrap();
        assert_eq!(lenient.flight.samples.len(), 94);
    }

    #[test]
    fn a_missing_column_is_named_with_what_would_satisfy_it() {
        let error =
            read(b"time_s,roll_rad,pitch_rad,p_radps,q_radps,r_radps\n").unwrap_err().to_string();
        assert!(error.contains("`airspeed_mps`") && error.contains("flight.csv"), "{error}");
        let error =
            read(b"time_s,roll_rad,pitch_rad,p_radps,q_radps,r_radps,airspeed_mps\n").unwrap_err();
        assert!(error.to_string().contains("`aileron_rad`"), "{error}");
    }

    #[test]
    fn an_unknown_column_is_reported_once_and_disturbs_nothing() {
        let mut out = Vec::new();
        let mut rows = Rows::new(&mut out, &["mode"]).unwrap();
        let flight = flown(5);
        for sample in &flight.samples {
            rows.row(sample, &["HOLD"]).unwrap();
        }
        let reading = read(&out).unwrap();
        assert_eq!(reading.unknown_columns, vec!["mode"]);
        assert_eq!(reading.flight.samples, flight.samples);
    }

    #[test]
    fn garbage_is_an_error_or_an_empty_flight_but_no_panic() {
        for bytes in [&b""[..], b"\n\n", b"\xff\xfe\x00\n1,2\n", b"time_s\n\"", &[0u8; 300]] {
            assert!(read(bytes).is_err());
        }
    }

    #[test]
    fn an_existing_file_is_not_overwritten() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("flight.csv");
        save(&flown(2), &path).unwrap();
        assert!(matches!(save(&flown(9), &path), Err(CsvError::File { .. })));
        assert_eq!(load(&path, Tolerance::Strict).unwrap().flight.samples.len(), 2);
    }
}
