//! A log file of any format read onto the one table.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::csv::{self, CsvError, Tolerance};
use super::finding::{Finding, Severity};
use super::format::Format;
use super::mapping::Mapping;
use super::phases::Flying;
use super::topics::{Topics, period_s};
use super::{Flight, FlowAngles, Sample, dataflash, derive, rows, screening, table, tlog, ulog};
use crate::columns::COLUMNS;

/// How a log is read.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// What to do with many unusable rows.
    pub tolerance: Tolerance,
    /// Where columns come from, where that is not the format's usual place.
    pub mapping: Mapping,
    /// From when on the aircraft flies.
    pub flies: Flying,
}

/// A channel of the file that fills columns of the table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Channel {
    /// The columns that it fills.
    pub columns: Vec<String>,
    /// Its topic with fields in the file.
    pub origin: String,
    /// Usable samples.
    pub samples: usize,
    /// Samples a second, by the median period.
    pub rate_hz: f64,
    /// Longest time between two samples, s.
    pub largest_gap_s: f64,
}

/// A log read from a file.
#[derive(Clone, Debug)]
pub struct Log {
    /// The file's format.
    pub format: Format,
    /// The table.
    pub flight: Flight,
    /// What fills it.
    pub channels: Vec<Channel>,
    /// Topics of the file (name, instance, records), used or not.
    pub topics: Vec<(String, u16, usize)>,
    /// Rows of the table dropped as out of order, repeated, incomplete or impossible.
    pub dropped: usize,
    /// The numbers of the first of them; in a CSV the header is row 1, else the first row is.
    pub dropped_rows: Vec<usize>,
    /// What its user should know.
    pub findings: Vec<Finding>,
    /// From when on the aircraft was taken to fly.
    pub flies: Flying,
}

impl Log {
    /// What makes figures that are computed from it wrong, a line each; `None` if nothing was found.
    pub fn problems(&self) -> Option<String> {
        let problems = self.findings.iter().filter(|f| f.severity == Severity::Problem);
        let lines: Vec<&str> = problems.map(|f| f.text.as_str()).collect();
        (!lines.is_empty()).then(|| lines.join("; "))
    }
}

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read.
    #[error("cannot read flight log {}: {source}: check the path and its permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is empty.
    #[error("flight log {} is empty: the logger wrote nothing, or the copy failed", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The file is none of the formats.
    #[error("{} is no flight log: it begins neither like a CSV table nor a PX4 ULog, an ArduPilot DataFlash .bin or a MAVLink .tlog", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The columns of a CSV table are not separated by commas.
    #[error(
        "flight log {}: its columns are separated by {separator}: write it with commas between columns and a point in numbers",
        path.display()
    )]
    Separator {
        /// The file.
        path: PathBuf,
        /// What separates them.
        separator: &'static str,
    },
    /// The CSV is wrong.
    #[error("{error}{hint}")]
    Csv {
        /// What is wrong.
        error: CsvError,
        /// What it looks like.
        hint: String,
    },
    /// A needed column is filled by nothing in the file.
    #[error("flight log {} has nothing for column `{column}`: {remedy}", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The column.
        column: &'static str,
        /// What would satisfy it.
        remedy: String,
    },
    /// Too many rows cannot be used.
    #[error("flight log {}: {dropped} of {rows} rows are unusable ({reasons}; first: row {first}), above 5 %: repair it or read it leniently{hint}", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// Rows dropped.
        dropped: usize,
        /// Rows of the table.
        rows: usize,
        /// Why, with counts.
        reasons: String,
        /// The first of those dropped.
        first: usize,
        /// What it looks like.
        hint: String,
    },
}

/// Whether a log is to be computed with, or only looked at.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Use {
    Compute,
    Look,
}

/// Reads as much of a log as there is, for a look at it: missing columns with unusable rows are
/// findings, not errors.
///
/// # Errors
/// The file cannot be read, or is no log.
pub fn inspect(path: &Path, options: &Options) -> Result<Log, LogError> {
    parse_for(&read(path)?, path, options, Use::Look)
}

/// Reads a log, whatever its format.
///
/// # Errors
/// The file cannot be read, is no log, lacks a needed column, or has too many unusable rows.
pub fn load(path: &Path, options: &Options) -> Result<Log, LogError> {
    parse(&read(path)?, path, options)
}

fn read(path: &Path) -> Result<Vec<u8>, LogError> {
    std::fs::read(path).map_err(|source| LogError::File { path: path.to_owned(), source })
}

/// Reads a log from bytes; `path` is what errors and the flight call it.
///
/// # Errors
/// As [`load`].
pub fn parse(bytes: &[u8], path: &Path, options: &Options) -> Result<Log, LogError> {
    parse_for(bytes, path, options, Use::Compute)
}

fn parse_for(bytes: &[u8], path: &Path, options: &Options, to: Use) -> Result<Log, LogError> {
    if bytes.is_empty() {
        return Err(LogError::Empty { path: path.to_owned() });
    }
    if let Some(separator) = separator(bytes) {
        return Err(LogError::Separator { path: path.to_owned(), separator });
    }
    let Some(format) = Format::of(bytes) else {
        return Err(LogError::Foreign { path: path.to_owned() });
    };
    let wanted = |topic: &str| options.mapping.wants(format, topic);
    let topics = match format {
        Format::Csv => return text(bytes, path, options, to),
        Format::Ulog => ulog::read(bytes, &wanted),
        Format::Dataflash => dataflash::read(bytes, &wanted),
        Format::Tlog => tlog::read(bytes, &wanted),
    };
    binary(format, topics, path, options, to)
}

/// What separates the columns of a table of this format that is not written with commas.
fn separator(bytes: &[u8]) -> Option<&'static str> {
    let header = bytes.split(|b| *b == b'\n').next()?;
    let header = std::str::from_utf8(header).ok().filter(|h| !h.contains(','))?;
    let named = |by: char| header.split(by).any(|name| name.trim() == "time_s");
    [(';', "semicolons"), ('\t', "tabs")]
        .into_iter()
        .find(|(by, _)| named(*by))
        .map(|(_, name)| name)
}

fn binary(
    format: Format,
    topics: Topics,
    path: &Path,
    o: &Options,
    to: Use,
) -> Result<Log, LogError> {
    let rules = o.mapping.rules(format, &topics);
    let mut table = table::build(&topics, &rules);
    table.missing.retain(|missing| !o.mapping.makes(missing.column));
    table.notes.extend(derive::apply(&mut table.rows, &o.mapping));
    let mut findings = Vec::new();
    for missing in &table.missing {
        let error = missing_column(path, &topics, missing);
        if to == Use::Compute {
            return Err(error);
        }
        findings.push(Finding::problem(error.to_string()));
    }
    findings.extend(topics.findings);
    findings.extend(screening::screen(&table.rows, &o.flies));
    let (mut kept, looked_at) = sorted_out(table.rows, to);
    if !table.missing.is_empty() {
        kept = looked_at;
    } else if let Some(first) = kept.refused(o.tolerance) {
        let (dropped, rows, hint) = (kept.dropped, kept.total, hint(&findings));
        let (path, reasons) = (path.to_owned(), kept.reasons());
        let error = LogError::Unusable { path, dropped, rows, reasons, first, hint };
        if to == Use::Compute {
            return Err(error);
        }
        findings.push(Finding::problem(error.to_string()));
        kept = looked_at;
    }
    findings.extend(dropped(kept.dropped, &kept.dropped_rows));
    findings.extend(table.notes.iter().map(Finding::note));
    Ok(Log {
        format,
        flight: Flight {
            name: name(path),
            samples: kept.samples,
            flow_angles: match format {
                // AOA.AOA and AOA.SSA are estimates unless a mapping names them as sensors
                Format::Dataflash if o.mapping.get("alpha_rad").is_none() => FlowAngles::Estimated,
                _ => FlowAngles::Measured,
            },
            sensors: o.mapping.sensors().clone(),
            unknown_columns: Vec::new(),
            notes: table.notes,
        },
        channels: table.channels,
        topics: topics.counts.into_iter().map(|((name, i), n)| (name, i, n)).collect(),
        dropped: kept.dropped,
        dropped_rows: kept.dropped_rows,
        findings,
        flies: o.flies,
    })
}

/// The rows fit to compute with, and those fit to be looked at where that is asked.
fn sorted_out(samples: Vec<Sample>, to: Use) -> (rows::Rows, rows::Rows) {
    let (mut kept, mut looked_at) = (rows::Rows::default(), rows::Rows::default());
    for (i, sample) in samples.into_iter().enumerate() {
        kept.take(i + 1, Some(sample));
        if to == Use::Look {
            looked_at.take_incomplete(i + 1, sample);
        }
    }
    (kept, looked_at)
}

fn text(bytes: &[u8], path: &Path, options: &Options, to: Use) -> Result<Log, LogError> {
    let bare = |error| LogError::Csv { error, hint: String::new() };
    let mut raw = csv::raw(bytes, path, &options.mapping).map_err(bare)?;
    let missing = std::mem::take(&mut raw.missing);
    let lacking = !missing.is_empty();
    let mut findings: Vec<Finding> = Vec::new();
    for source in missing {
        if to == Use::Compute {
            return Err(bare(source));
        }
        findings.push(Finding::problem(source.to_string()));
    }
    let made = derive::apply(&mut raw.rows, &options.mapping);
    findings.extend(screening::screen(&raw.rows, &options.flies));
    findings.extend(made.iter().map(Finding::note));
    let reading = if lacking {
        csv::keep_all(raw, path)
    } else {
        let poor = csv::poor(&raw, path, options.tolerance);
        if let (Some(source), Use::Look) = (&poor, to) {
            findings.push(Finding::problem(source.to_string()));
        }
        let tolerance = if to == Use::Look { Tolerance::Lenient } else { options.tolerance };
        csv::settle(raw, path, tolerance)
            .map_err(|error| LogError::Csv { error, hint: hint(&findings) })?
    };
    if reading.cut_short {
        findings.push(Finding::warning("the file ends in the middle of a row, which is left out"));
    }
    if !reading.unknown_columns.is_empty() {
        let names = reading.unknown_columns.join(", ");
        findings.push(Finding::note(format!("columns that the log format does not name: {names}")));
    }
    findings.extend(dropped(reading.dropped, &reading.dropped_rows));
    let channels = text_channels(&reading.flight, &options.mapping);
    let (sensors, notes) = (options.mapping.sensors().clone(), made);
    Ok(Log {
        format: Format::Csv,
        channels,
        topics: Vec::new(),
        flight: Flight { sensors, notes, ..reading.flight },
        dropped: reading.dropped,
        dropped_rows: reading.dropped_rows,
        findings,
        flies: options.flies,
    })
}

/// The columns of a CSV that hold anything.
fn text_channels(flight: &Flight, mapping: &Mapping) -> Vec<Channel> {
    let channel = |(name, get, _): &(&str, fn(&Sample) -> f64, _)| {
        let seen = flight.samples.iter().filter(|s| get(s).is_finite()).map(|s| s.time_s);
        let times: Vec<f64> = seen.collect();
        let period = period_s(&times);
        (!times.is_empty()).then(|| Channel {
            columns: vec![(*name).to_owned()],
            origin: mapping.origin(name),
            samples: times.len(),
            rate_hz: if period > 0.0 { 1.0 / period } else { 0.0 },
            largest_gap_s: times.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max),
        })
    };
    COLUMNS.iter().skip(1).filter_map(channel).collect()
}

fn name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// What wrong units may have made rows unusable, for an error: the findings of `screening` whose text says "look"
/// ("looks like degrees"), so such a text must keep that word.
fn hint(findings: &[Finding]) -> String {
    findings.iter().filter(|f| f.text.contains("look")).map(|f| format!("; {}", f.text)).collect()
}

fn dropped(count: usize, numbers: &[usize]) -> Option<Finding> {
    let list = numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    let more = if count > numbers.len() { " …" } else { "" };
    (count > 0).then(|| {
        Finding::warning(format!(
            "{count} rows dropped as out of order, repeated, incomplete or impossible (rows {list}{more})"
        ))
    })
}

fn missing_column(path: &Path, topics: &Topics, missing: &table::Missing) -> LogError {
    let or = missing.or.map(|p| format!(" (or of `{p}`)")).unwrap_or_default();
    let mut has: Vec<&str> = topics.counts.keys().map(|(name, _)| name.as_str()).collect();
    has.dedup();
    let has = match has.len() {
        0 => "nothing that could be decoded".to_owned(),
        1..=40 => has.join(", "),
        n => format!("{n} topics, the first of them {}", has[..40].join(", ")),
    };
    let looked = match missing.looked_for.is_empty() {
        true => "no topic of this format is known for it".to_owned(),
        false => format!("log {}{or}", missing.looked_for.join(" or ")),
    };
    let remedy =
        format!("{looked}, or name another source in a mapping (--mapping); the file holds {has}");
    LogError::Missing { path: path.to_owned(), column: missing.column, remedy }
}
