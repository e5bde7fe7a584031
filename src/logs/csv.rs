//! The CSV form of a flight log: one row a sample, a header row, SI units.

mod dialect;
mod quaternion;
mod write;

pub use super::rows::Tolerance;
pub use quaternion::Order;
pub use write::Rows;
pub use write::save;
pub use write::write;

use std::collections::BTreeSet;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::columns::{COLUMNS, EITHER, NEEDED, Place, index};
use super::mapping::{Mapping, TEXT};
use super::topics::period_s;
use super::{Flight, Sample, mixed, rows};
use dialect::Dialect;

/// Why a CSV flight log cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CsvError {
    /// The file cannot be opened, read or written.
    #[error("cannot {doing} flight log {path}: {source}: check the path and its permissions")]
    File {
        /// What was being done.
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The text is no CSV.
    #[error("flight log {path}: {source}: correct the row or cut the file before it")]
    Text {
        /// The file.
        path: PathBuf,
        /// What the CSV reader said.
        source: ::csv::Error,
    },
    /// A needed column is missing.
    #[error("flight log {path} has no column `{column}`: {remedy}")]
    Column {
        /// The file.
        path: PathBuf,
        /// The column.
        column: &'static str,
        /// What would satisfy it.
        remedy: String,
    },
    /// Too many rows cannot be used.
    #[error(
        "flight log {path}: {dropped} of {rows} rows are unusable ({reasons}; first: row {first}), above 5 %: repair it or read it leniently"
    )]
    Unusable {
        /// The file.
        path: PathBuf,
        /// Rows dropped.
        dropped: usize,
        /// Rows read.
        rows: usize,
        /// Why, with counts.
        reasons: String,
        /// The first of those dropped, the header being row 1.
        first: usize,
    },
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
    let mut raw = raw(bytes, path, &Mapping::default())?;
    if !raw.missing.is_empty() {
        return Err(raw.missing.remove(0));
    }
    settle(raw, path, tolerance)
}

/// A table as it stands in the file, before any row is judged.
#[derive(Default)]
pub(super) struct Raw {
    /// The rows that could be read and have a time.
    pub rows: Vec<Sample>,
    /// How many of the file's rows stand before each of them.
    places: Vec<usize>,
    /// The rows of the file that are its own, of which those left out on purpose count as none.
    range: Range<usize>,
    left_out: BTreeSet<usize>,
    /// The needed columns that it lacks.
    pub missing: Vec<CsvError>,
    unknown_columns: Vec<String>,
    cut_short: bool,
    /// What was read under other names.
    pub notes: Vec<String>,
}

/// How far a time goes back where another recording begins: in median periods, and s.
const BACK_PERIODS: f64 = 10.0;
const BACK_S: f64 = 1.0;
/// Rows that a recording has at least.
const RECORDING: usize = 50;

impl Raw {
    /// The rows, those that could not be read included, as `take` judges them.
    fn judged(&self, take: impl Fn(&mut rows::Rows, usize, Option<Sample>)) -> rows::Rows {
        let mut rows = rows::Rows::with_sparse_columns_of(&self.rows);
        let mut next = self.rows.iter().zip(&self.places).peekable();
        for i in self.range.clone().filter(|i| !self.left_out.contains(i)) {
            let own = next.next_if(|(_, place)| **place == i).map(|(sample, _)| *sample);
            // The header is row 1.
            take(&mut rows, i + 2, own);
        }
        rows
    }

    /// Takes out rows on purpose; how many.
    pub fn leave_out(&mut self, is: impl Fn(&Sample) -> bool) -> usize {
        let before = self.left_out.len();
        let out = self.rows.iter().zip(&self.places).filter(|(row, _)| is(row));
        self.left_out.extend(out.map(|(_, place)| *place).collect::<Vec<_>>());
        let places = std::mem::take(&mut self.places);
        let rows = std::mem::take(&mut self.rows).into_iter().zip(places);
        (self.rows, self.places) = rows.filter(|(row, _)| !is(row)).unzip();
        self.left_out.len() - before
    }

    /// The recordings that stand one after the other: each begins where the time goes back and stays there.
    pub fn recordings(self) -> Vec<Raw> {
        let times: Vec<f64> = self.rows.iter().map(|s| s.time_s).collect();
        let back = (BACK_PERIODS * period_s(&times)).max(BACK_S);
        let mut bounds = vec![0];
        for i in 1..times.len() {
            let whole = i - bounds[bounds.len() - 1] >= RECORDING && times.len() - i >= RECORDING;
            let goes_back = times[i] < times[i - 1] - back;
            if whole
                && goes_back
                && times[i..i + RECORDING].iter().all(|t| *t < times[i - 1] - 0.5 * back)
            {
                bounds.push(i);
            }
        }
        if bounds.len() == 1 || !self.missing.is_empty() {
            return vec![self];
        }
        bounds.push(times.len());
        let last = bounds.len() - 2;
        let one = |k: usize| {
            let (from, to) = (bounds[k], bounds[k + 1]);
            let first = if k == 0 { self.range.start } else { self.places[from] };
            let end = if k == last { self.range.end } else { self.places[to] };
            Raw {
                rows: self.rows[from..to].to_vec(),
                places: self.places[from..to].to_vec(),
                range: first..end,
                left_out: BTreeSet::new(),
                missing: Vec::new(),
                unknown_columns: self.unknown_columns.clone(),
                cut_short: self.cut_short && k == last,
                notes: self.notes.clone(),
            }
        };
        (0..=last).map(one).collect()
    }
}

/// Where a field goes: place, scale, offset; whether it is one part of a sum.
type Target = (Place, f64, f64, Part);

/// Whether a field is a column, or one of several surfaces that make one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Whole,
    OneOfSeveral,
}

/// What separates the columns of a table: commas, else semicolons or tabs.
fn separator(header: &[u8]) -> u8 {
    let count = |by: u8| header.iter().filter(|b| **b == by).count();
    if count(b',') > 0 && count(b';') <= count(b',') {
        return b',';
    }
    [b';', b'\t']
        .into_iter()
        .max_by_key(|by| count(*by))
        .filter(|by| count(*by) > 0)
        .unwrap_or(b',')
}

/// Reads the rows, taking columns under other names or in other units where `mapping` says so.
pub(super) fn raw(bytes: &[u8], path: &Path, mapping: &Mapping) -> Result<Raw, CsvError> {
    let text = |source| CsvError::Text { path: path.to_owned(), source };
    // A row without its line end may miss digits: it is left out.
    let end = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let delimiter = separator(bytes.split(|b| *b == b'\n').next().unwrap_or_default());
    let mut reader = ::csv::ReaderBuilder::new();
    let mut reader = reader.flexible(true).delimiter(delimiter).from_reader(&bytes[..end]);
    let header = reader.byte_headers().map_err(text)?.clone();
    let names: Vec<String> =
        header.iter().map(|h| String::from_utf8_lossy(h).trim().to_owned()).collect();
    let dialect = Dialect::of(&names, mapping);
    let mut targets: Vec<Vec<Target>> =
        names.iter().map(|name| targets(name, mapping, &dialect)).collect();
    let mixed = mixed::columns(&names, mapping);
    for part in &mixed {
        targets[part.field].push((part.place, part.share, 0.0, Part::OneOfSeveral));
    }
    let mut made: Vec<String> = mixed.iter().map(|part| part.column.to_owned()).collect();
    made.extend(COLUMNS.iter().filter(|c| dialect.fills(c.0)).map(|c| c.0.to_owned()));
    let missing = missing_columns(&[names.clone(), made].concat(), mapping, path);
    let unknown = names.iter().zip(&targets).filter(|(_, targets)| targets.is_empty());
    let unknown = unknown.map(|(name, _)| name.clone());
    let mut out = Raw {
        missing,
        unknown_columns: unknown.filter(|n| !n.is_empty() && !dialect.reads(n)).collect(),
        cut_short: end < bytes.len(),
        notes: dialect.said().into_iter().collect(),
        ..Raw::default()
    };
    let parts = dialect.quaternion.as_ref().map(|q| {
        q.each_ref().map(|name| names.iter().position(|n| n == name).unwrap_or(usize::MAX))
    });
    let mut quaternions: Vec<[f64; 4]> = Vec::new();
    let comma = if delimiter == b',' { Decimal::Point } else { Decimal::PointOrComma };
    for record in reader.byte_records() {
        let record = record.map_err(text)?;
        // A row that lacks fields is damaged, and would take many times its size.
        let whole = record.len() >= targets.len();
        let sample = sample(&record, &targets, comma).filter(|s| whole && s.time_s.is_finite());
        if let Some(sample) = sample {
            out.rows.push(sample);
            out.places.push(out.range.end);
            quaternions.extend(parts.map(|q| {
                q.map(|i| record.get(i).and_then(|f| number(f, comma)).unwrap_or(f64::NAN))
            }));
        }
        out.range.end += 1;
    }
    if dialect.quaternion.is_some() {
        let order = mapping.quaternion().and_then(|q| q.order);
        let order = order.unwrap_or_else(|| quaternion::order(&out.rows, &quaternions));
        quaternion::fill(&mut out.rows, &quaternions, order);
    }
    if dialect.time_by_steps {
        in_seconds(&mut out.rows);
    }
    Ok(out)
}

/// Turns times of a unit that their steps show into seconds.
fn in_seconds(rows: &mut [Sample]) {
    let times: Vec<f64> = rows.iter().map(|s| s.time_s).collect();
    let unit = dialect::unit_of(period_s(&times));
    rows.iter_mut().for_each(|row| row.time_s *= unit);
}

/// How decimals may be written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Decimal {
    Point,
    PointOrComma,
}

/// The number in a field; NaN of an empty one, `None` of what is neither a number nor a date.
fn number(field: &[u8], decimal: Decimal) -> Option<f64> {
    let field = std::str::from_utf8(field).ok()?.trim();
    if field.is_empty() {
        return Some(f64::NAN);
    }
    let plain = field.parse().ok();
    let comma = || match decimal {
        Decimal::PointOrComma if field.contains(',') => field.replacen(',', ".", 1).parse().ok(),
        _ => None,
    };
    plain.or_else(comma).or_else(|| dialect::time(field))
}

/// What [`settle`] would say against a table.
pub(super) fn poor(raw: &Raw, path: &Path, tolerance: Tolerance) -> Option<CsvError> {
    refusal(&raw.judged(rows::Rows::take), path, tolerance)
}

fn refusal(rows: &rows::Rows, path: &Path, tolerance: Tolerance) -> Option<CsvError> {
    rows.refused(tolerance).map(|first| CsvError::Unusable {
        path: path.to_owned(),
        dropped: rows.dropped,
        rows: rows.total,
        reasons: rows.reasons(),
        first,
    })
}

/// Drops the unusable rows, refuses the table if they are too many.
pub(super) fn settle(raw: Raw, path: &Path, tolerance: Tolerance) -> Result<Reading, CsvError> {
    let rows = raw.judged(rows::Rows::take);
    if let Some(error) = refusal(&rows, path, tolerance) {
        return Err(error);
    }
    Ok(reading(raw, rows, path))
}

/// Keeps every row that is later than the last one, complete or not: for a look at the table.
pub(super) fn keep_all(raw: Raw, path: &Path) -> Reading {
    let rows = raw.judged(|rows, number, sample| match sample {
        Some(sample) => rows.take_incomplete(number, sample),
        None => rows.take(number, None),
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

/// Where the file's column `name` goes.
fn targets(name: &str, mapping: &Mapping, dialect: &Dialect) -> Vec<Target> {
    let mut targets: Vec<Target> = mapping
        .of_topic(TEXT)
        .filter(|(_, entry)| entry.field == name)
        .filter_map(|(column, e)| Some((COLUMNS[index(column)?].2, e.scale, e.offset, Part::Whole)))
        .collect();
    if mapping.get(name).is_none()
        && let Some(i) = index(name)
    {
        targets.push((COLUMNS[i].2, 1.0, 0.0, Part::Whole));
    }
    let under_other_names = dialect.found.iter().filter(|f| f.field == name);
    targets.extend(
        under_other_names
            .filter_map(|f| Some((COLUMNS[index(&f.column)?].2, f.scale, f.offset, Part::Whole))),
    );
    targets
}

/// The needed columns that are not among `names`, each with what would satisfy it.
fn missing_columns(names: &[String], mapping: &Mapping, path: &Path) -> Vec<CsvError> {
    let has = |column: &str| {
        let name = mapping.get(column).map_or(column, |entry| &entry.field);
        names.iter().any(|n| n == name)
    };
    let missing = |column, remedy| CsvError::Column { path: path.to_owned(), column, remedy };
    let alone = NEEDED.into_iter().filter(|column| !has(column) && !mapping.makes(column));
    let alone =
        alone.map(|column| missing(column, "add it, in the unit its name ends with".into()));
    let either = EITHER.into_iter().filter(|(command, position)| !has(command) && !has(position));
    let either = either.map(|(command, position)| {
        missing(command, format!("add it, or the position `{position}`"))
    });
    alone.chain(either).collect()
}

/// The sample of a record; `None` when a field is no number.
fn sample(record: &::csv::ByteRecord, targets: &[Vec<Target>], decimal: Decimal) -> Option<Sample> {
    let mut sample = Sample::default();
    for (field, targets) in record.iter().zip(targets).filter(|(_, t)| !t.is_empty()) {
        let x = number(field, decimal)?;
        for (place, scale, offset, part) in targets.iter().filter(|_| !x.is_nan()) {
            let value = if (*scale, *offset) == (1.0, 0.0) { x } else { x * scale + offset };
            let place = place(&mut sample);
            let sums = *part == Part::OneOfSeveral && !place.is_nan();
            *place = if sums { *place + value } else { value };
        }
    }
    Some(sample)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flown(rows: usize) -> Flight {
        let sample = |i: usize| {
            let mut sample = Sample { time_s: i as f64 * 0.01, ..Sample::default() };
            // Every column a number of its own that no decimal fraction writes exactly.
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
        // Row 1 is the header, so sample 10 stands in row 12.
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
