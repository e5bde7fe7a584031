//! Reads the flights of a CSV table and checks them. A table may contain several recordings, one after the other.

use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::Path;

use super::columns::{BLOCK, COLUMNS, Column, EITHER};
use super::csv::{self, CsvError, Raw};
use super::error::LogError;
use super::finding::{Finding, named};
use super::load::{Channel, Log, Options, Use, dropped, hint, name};
use super::mapping::{Entry, Mapping};
use super::phases::Flying;
use super::quality::Quality;
use super::stretches::Keep;
use super::topics::period_s;
use super::{Flight, Format, Sample, assess, derive, quoted, screening};

/// Reads the flights of a CSV table, one for each recording in it.
///
/// # Errors
/// The text is not a table. A single flight has its own error if it lacks a required column or has too many unusable
/// rows.
pub(super) fn read(
    source: &mut dyn BufRead,
    path: &Path,
    options: &Options,
    to: Use,
    keep: Keep,
) -> Result<Vec<Result<Log, LogError>>, LogError> {
    let bare = |error| match error {
        CsvError::Text { source, .. } if source.is_io_error() => {
            LogError::File { path: path.to_owned(), source: source.into() }
        }
        error => LogError::Csv { error, hint: String::new() },
    };
    let recordings = csv::read(source, path, &options.mapping, keep).map_err(bare)?.recordings();
    let several = recordings.len() > 1;
    let one = |(k, raw): (usize, Raw)| {
        let life = several.then(|| format!("recording {}", k + 1));
        let name = if several { format!("{}#{}", name(path), k + 1) } else { name(path) };
        recording(raw, path, options, to).map(|mut log| {
            log.flight.name = name;
            log.life = life;
            log
        })
    };
    Ok(recordings.into_iter().enumerate().map(one).collect())
}

/// Text of the finding about a file that ends in the middle of a row.
const CUT_SHORT: &str = "the file ends in the middle of a row, which is left out";

fn recording(mut raw: Raw, path: &Path, options: &Options, to: Use) -> Result<Log, LogError> {
    let missing = std::mem::take(&mut raw.missing);
    let lacking = !missing.is_empty();
    let mut findings: Vec<Finding> = Vec::new();
    let timeless = missing.iter().any(|m| matches!(m, CsvError::Column { column: "time_s", .. }));
    let several = missing.len() > 1;
    if several && to == Use::Look {
        findings.push(lacks(path, &missing, &raw.unknown_columns));
    } else if to == Use::Compute && lacking {
        return Err(LogError::Csv { error: refused(missing), hint: String::new() });
    } else if let [first] = &missing[..] {
        findings.push(Finding::problem(first.to_string()));
    }
    let (mut made, entries) = (std::mem::take(&mut raw.notes), std::mem::take(&mut raw.entries));
    let flies = Flying { bridged_s: raw.bridged_s(), ..options.flies };
    let mut channels = channels(&raw, &options.mapping, &entries);
    let stretches = raw.stretches(&options.flies);
    if let Some(stretches) = &stretches {
        findings.push(Finding::note(stretches.said()));
        channels.iter_mut().for_each(|channel| raw.of_all(stretches, channel));
    }
    findings.extend(assess::freeze(&mut raw.rows, &channels, &flies));
    raw.leave_out(|row| assess::hangs(row, &channels));
    made.extend(derive::apply(&mut raw.rows, &options.mapping));
    findings.extend(assess::channels(&channels, &raw.rows, &flies));
    if !timeless {
        let found = screening::screened(&mut raw.rows, &flies);
        findings.extend(found.into_iter().map(|f| named(f, &entries, Format::Csv)));
    }
    findings.extend(made.iter().map(Finding::note));
    let reading = match lacking {
        true => csv::keep_all(raw, path),
        false => settled(raw, path, options, to, &mut findings)?,
    };
    findings.extend(reading.cut_short.then(|| Finding::warning(CUT_SHORT)));
    if !several && !reading.unknown_columns.is_empty() {
        let names = reading.unknown_columns.join(", ");
        findings.push(Finding::note(format!("columns that the log format does not name: {names}")));
    }
    // Without times every row is dropped. The finding about the missing column suffices.
    findings.extend(dropped(reading.dropped, &reading.dropped_rows).filter(|_| !timeless));
    let (sensors, notes) = (options.mapping.sensors().clone(), made);
    Ok(Log {
        format: Format::Csv,
        channels,
        entries,
        topics: Vec::new(),
        flight: Flight { sensors, notes, ..reading.flight },
        dropped: reading.dropped,
        dropped_rows: reading.dropped_rows,
        findings,
        flies,
        vehicle: None,
        hovers: Vec::new(),
        sources: Vec::new(),
        life: None,
        stretches,
    })
}

/// Returns the usable rows of a table that lacks no column. Too many unusable rows are an error for a computation, and a
/// finding for an inspection.
fn settled(
    raw: Raw,
    path: &Path,
    options: &Options,
    to: Use,
    findings: &mut Vec<Finding>,
) -> Result<csv::Reading, LogError> {
    match (csv::settle(raw, path, options.tolerance), to) {
        ((_, Some(error)), Use::Compute) => Err(LogError::Csv { error, hint: hint(findings) }),
        ((reading, poor), _) => {
            findings.extend(poor.map(|error| Finding::problem(error.to_string())));
            Ok(reading)
        }
    }
}

/// Largest number of column names in a finding.
const SHOWN: usize = 40;

/// Largest number of missing columns that an error names after the first.
const ALSO: usize = 3;

/// The names of the columns of `missing`, each with its alternative.
fn columns_of(missing: &[CsvError]) -> Vec<String> {
    let either = |column: &str| EITHER.iter().find(|(command, _)| *command == column);
    let named = missing.iter().filter_map(|error| match error {
        CsvError::Column { column, .. } => Some(match either(column) {
            Some((command, position)) => format!("`{command}` (or `{position}`)"),
            None => format!("`{column}`"),
        }),
        _ => None,
    });
    named.collect()
}

/// The error about a table that lacks the columns `missing`, of which there is at least one.
fn refused(mut missing: Vec<CsvError>) -> CsvError {
    let (path, column, remedy) = match missing.remove(0) {
        CsvError::Column { path, column, remedy } => (path, column, remedy),
        other => return other,
    };
    let mut also = columns_of(&missing);
    let more = also.len().saturating_sub(ALSO);
    also.truncate(ALSO);
    let also = match (also.len(), more) {
        (0, _) => String::new(),
        (_, 0) => format!("; it also lacks {}", also.join(", ")),
        _ => format!("; it also lacks {} and {more} more", also.join(", ")),
    };
    let all = quoted(&path);
    let remedy = format!(
        "{remedy}{also}. --mapping FILE takes columns of other names, and `greylag logs info {all}` lists what is there and what is missing"
    );
    CsvError::Column { path, column, remedy }
}

/// Finding about a table that lacks several columns. It also names columns of the table that are not known.
fn lacks(path: &Path, missing: &[CsvError], unknown: &[String]) -> Finding {
    let shown: Vec<&str> = unknown.iter().take(SHOWN).map(String::as_str).collect();
    let more = if unknown.len() > SHOWN { " …" } else { "" };
    let has = match shown.is_empty() {
        true => String::new(),
        false => format!("; other columns of it: {}{more}", shown.join(", ")),
    };
    Finding::problem(format!(
        "flight log {} has no column {}: add them, in the units that their names end with, or name the file's own columns in a mapping (--mapping){has}",
        path.display(),
        columns_of(missing).join(", ")
    ))
}

/// A channel for each column of the table that has values.
fn channels(raw: &Raw, mapping: &Mapping, entries: &BTreeMap<String, Entry>) -> Vec<Channel> {
    let channel = |name: &str, [times, values]: [Vec<f64>; 2]| {
        let period = period_s(&times);
        let mut quality = Quality::at(name, &times, &values, period);
        if let Some(frozen) = raw.frozen(name, &times, &values) {
            quality.frozen = frozen;
        }
        (!times.is_empty()).then(|| Channel {
            columns: vec![name.to_owned()],
            origin: mapping.origin(name, entries.get(name)),
            samples: times.len(),
            rate_hz: if period > 0.0 { 1.0 / period } else { 0.0 },
            largest_gap_s: times.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max),
            quality,
        })
    };
    let columns: &[Column] = &COLUMNS;
    let groups = columns[1..].chunks(AT_ONCE);
    let all = groups.flat_map(|group| group.iter().zip(seen(&raw.rows, group)));
    all.filter_map(|(column, seen)| channel(column.0, seen)).collect()
}

/// Number of columns whose values are in memory at a time: those of all columns would take more memory than a long table.
const AT_ONCE: usize = 7;

/// Times (s) and values of the samples in each of the columns `group`.
fn seen(rows: &[Sample], group: &[Column]) -> Vec<[Vec<f64>; 2]> {
    let mut seen = vec![[Vec::new(), Vec::new()]; group.len()];
    for block in rows.chunks(BLOCK) {
        for ([times, values], (_, get, _)) in seen.iter_mut().zip(group) {
            let there = block.iter().map(|s| (s.time_s, get(s))).filter(|(_, x)| x.is_finite());
            for (time, value) in there {
                times.push(time);
                values.push(value);
            }
        }
    }
    seen
}
