//! A table as read from its file, before rows are judged.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

use super::CsvError;
use super::dialect::{self, Dialect};
use super::quaternion;
use crate::columns::{COLUMNS, EITHER, NEEDED, Place, index};
use crate::mapping::{Mapping, TEXT};
use crate::topics::period_s;
use crate::{Sample, mixed, rows};

/// A table as read from its file, before rows are judged.
#[derive(Default)]
pub(crate) struct Raw {
    /// The rows that could be read and have a time.
    pub rows: Vec<Sample>,
    /// Number of the file's rows before each row.
    places: Vec<usize>,
    /// The rows of the file that are its own, of which those left out on purpose count as none.
    range: Range<usize>,
    left_out: BTreeSet<usize>,
    /// The needed columns that it lacks.
    pub missing: Vec<CsvError>,
    pub(crate) unknown_columns: Vec<String>,
    pub(super) cut_short: bool,
    /// Notes on columns that were found under other names.
    pub notes: Vec<String>,
}

/// Backward jump of time that begins another recording: in median sample periods, and in s.
const BACK_PERIODS: f64 = 10.0;
const BACK_S: f64 = 1.0;
/// How far from the beginning of the recording before another one begins, in parts of its length.
const BEGINS: f64 = 0.1;
/// Rows that a recording has at least.
const RECORDING: usize = 50;

impl Raw {
    /// The rows, those that could not be read included, as `take` judges them.
    pub(super) fn judged(
        &self,
        take: impl Fn(&mut rows::Rows, usize, Option<Sample>),
    ) -> rows::Rows {
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

    /// The recordings that follow one another in the table: each begins where the time goes back
    /// and stays there.
    pub fn recordings(self) -> Vec<Raw> {
        let times: Vec<f64> = self.rows.iter().map(|s| s.time_s).collect();
        let back = (BACK_PERIODS * period_s(&times)).max(BACK_S);
        let mut bounds = vec![0];
        for i in 1..times.len() {
            let whole = i - bounds[bounds.len() - 1] >= RECORDING && times.len() - i >= RECORDING;
            let goes_back = times[i] < times[i - 1] - back;
            // A clock that is set jumps back by some seconds; a new recording starts again at the first time.
            let start = times[bounds[bounds.len() - 1]];
            let begins = times[i] < start + (BEGINS * (times[i - 1] - start)).max(back);
            let stays = || times[i..i + RECORDING].iter().all(|t| *t < times[i - 1] - 0.5 * back);
            if whole && goes_back && begins && stays() {
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

/// Destination of a field: column, scale, offset, and whether it is one term of a sum.
type Target = (Place, f64, f64, Part);

/// Whether a field is a column, or one of several surfaces that make one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Whole,
    OneOfSeveral,
}

/// Separator of a table's columns: commas, else semicolons or tabs.
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

/// Reads the rows; `mapping` may assign columns with other names or units.
pub(crate) fn raw(bytes: &[u8], path: &Path, mapping: &Mapping) -> Result<Raw, CsvError> {
    let text = |source| CsvError::Text { path: path.to_owned(), source };
    // A row without a line end may lack digits, so it is not read.
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

/// The number in a field; NaN if it is empty, `None` if it is neither a number nor a date.
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

/// Destination of the file's column `name`.
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

/// The required columns that are not among `names`, each with the columns that would replace it.
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

/// The sample of a record; `None` if a field is not a number.
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
