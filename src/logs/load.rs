//! Reads a log file of any format into one table.
//!
//! A finding is a defect or peculiarity of the log that is reported to the user. A mapping states which field of the file fills which
//! column.

use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::path::Path;

use serde::Serialize;

use super::csv::Tolerance;
use super::dataflash_text::Binary;
use super::door::{self, Opened};
use super::error::LogError;
use super::finding::{Finding, Severity};
use super::foreign;
use super::format::{DATAFLASH_MAGIC, Format};
use super::mapping::{Entry, Mapping};
use super::phases::{self, Flying, Phase, PhaseKind};
use super::quality::Quality;
use super::sources::{Asked, Source};
use super::stretches::{Keep, Stretches};
use super::topics::Topics;
use super::vehicle::Vehicle;
use super::{Flight, binary, dataflash, text, tlog, ulog};

/// Options for reading a log.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Number of unusable rows that is tolerated.
    pub tolerance: Tolerance,
    /// The user's mapping. Its sources of columns replace those that are built in for the format.
    pub mapping: Mapping,
    /// Criteria by which rows count as flight.
    pub flies: Flying,
    /// Topic instances that the user requested instead of those that the reader would choose.
    pub sources: Vec<Asked>,
}

/// A channel of the file that fills columns of the table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Channel {
    /// The columns that it fills.
    pub columns: Vec<String>,
    /// Topic and fields of the channel in the file.
    pub origin: String,
    /// Number of usable samples.
    pub samples: usize,
    /// Sample rate from the median sample period, Hz.
    pub rate_hz: f64,
    /// Longest time between two samples, s.
    pub largest_gap_s: f64,
    /// Quality of the samples.
    pub quality: Quality,
}

/// A log read from a file.
#[derive(Clone, Debug)]
pub struct Log {
    /// Format of the file.
    pub format: Format,
    /// Table of the log's rows.
    pub flight: Flight,
    /// Channels of the file that fill the table.
    pub channels: Vec<Channel>,
    /// For each column that a single field fills: the entry of a mapping file that fills it in the same way.
    pub entries: BTreeMap<String, Entry>,
    /// All topics of the file, used or not: name, instance and number of records.
    pub topics: Vec<(String, u16, usize)>,
    /// Number of rows dropped because they are out of order, repeated, incomplete or impossible.
    pub dropped: usize,
    /// Numbers of the first dropped rows. In a CSV the header is row 1; in other formats the first row of data is row
    /// 1.
    pub dropped_rows: Vec<usize>,
    /// Findings for the log's user.
    pub findings: Vec<Finding>,
    /// Criteria for flight that were applied.
    pub flies: Flying,
    /// The vehicle; `None` if the log does not name it.
    pub vehicle: Option<Vehicle>,
    /// Intervals (from, to), s, in which a VTOL is not wing-borne, for example in hover. Their rows are left out.
    pub hovers: Vec<(f64, f64)>,
    /// All instances of each topic that has more than one.
    pub sources: Vec<Source>,
    /// Vehicle and boot of this flight, in words; `None` if the file holds only one flight.
    pub life: Option<String>,
    /// Statistics of the whole log, if only parts of a long log are kept in memory for an inspection.
    pub stretches: Option<Stretches>,
}

impl Log {
    /// Texts of the findings of severity [`Severity::Problem`], joined by semicolons; `None` if there are none.
    pub fn problems(&self) -> Option<String> {
        let problems = self.findings.iter().filter(|f| f.severity == Severity::Problem);
        let lines: Vec<&str> = problems.map(|f| f.text.as_str()).collect();
        (!lines.is_empty()).then(|| lines.join("; "))
    }

    /// Phases on the ground and in flight, in order of time.
    pub fn phases(&self) -> Vec<Phase> {
        match &self.stretches {
            Some(stretches) => stretches.phases.clone(),
            None => phases::phases(&self.flight.samples, &self.flies),
        }
    }

    /// Time in flight, s.
    pub fn flown_s(&self) -> f64 {
        let phases = self.phases();
        let flown = phases.iter().filter(|p| p.kind == PhaseKind::Flight);
        flown.fold(0.0, |sum, p| sum + p.to_s - p.from_s)
    }
}

/// Whether a log is read for a computation, or only for inspection.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    Compute,
    Look,
}

/// Reads as much of a log as possible, for inspection. Missing columns and unusable rows become findings, not errors.
/// If the file holds several flights, the longest is returned.
///
/// # Errors
/// If the file cannot be read, or is not a log.
pub fn inspect(path: &Path, options: &Options) -> Result<Log, LogError> {
    longest(open(path, options, Use::Look)?)
}

/// Reads all flights of a log for inspection: one for each boot of each vehicle in it.
///
/// # Errors
/// The same as [`inspect`].
pub fn inspect_all(path: &Path, options: &Options) -> Result<Vec<Log>, LogError> {
    open(path, options, Use::Look)?.into_iter().collect()
}

/// Reads a log, whatever its format. If the file holds several flights, the longest is returned; the path `FILE#2`
/// selects the second one.
///
/// # Errors
/// If the file cannot be read, is not a log, lacks a required column, or has too many unusable rows.
pub fn load(path: &Path, options: &Options) -> Result<Log, LogError> {
    longest(open(path, options, Use::Compute)?)
}

/// Reads all flights of a log, one for each boot of each vehicle in it. Boots without time in flight are left out if another
/// boot has time in flight. A finding of the first flight lists them.
///
/// # Errors
/// The same as [`load`], if none of the flights can be read.
pub fn flights(path: &Path, options: &Options) -> Result<Vec<Log>, LogError> {
    let mut all = open(path, options, Use::Compute)?;
    if all.len() < 2 {
        return all.into_iter().collect();
    }
    let flies = |log: &Result<Log, LogError>| log.as_ref().is_ok_and(|log| log.flown_s() > 0.0);
    if !all.iter().any(flies) {
        return longest(all).map(|log| vec![log]);
    }
    let idle: Vec<String> = all.iter().filter(|l| !flies(l)).map(said_of).collect();
    all.retain(flies);
    let mut logs = all.into_iter().collect::<Result<Vec<Log>, LogError>>()?;
    let note = format!("left out, for they hold no flight: {}", idle.join("; "));
    let first = logs.first_mut().filter(|_| !idle.is_empty());
    first.into_iter().for_each(|log| log.findings.push(Finding::warning(&note)));
    Ok(logs)
}

/// Reads a log from bytes; `path` appears in errors and as the name of the flight.
///
/// # Errors
/// The same as [`load`].
pub fn parse(bytes: &[u8], path: &Path, options: &Options) -> Result<Log, LogError> {
    let start = &bytes[..bytes.len().min(door::LOOK)];
    longest(read(start, &mut &bytes[..], path, options, Use::Compute)?)
}

/// Name, boot and flight time of a log in words, or its error.
fn said_of(log: &Result<Log, LogError>) -> String {
    match log {
        Ok(log) => {
            let life = log.life.as_deref().unwrap_or_default();
            format!("{} ({life}, {:.1} s in flight)", log.flight.name, log.flown_s())
        }
        Err(error) => error.to_string(),
    }
}

/// Returns the log with the longest time in flight. A finding of this log lists the others. If no log can be read, returns the
/// first error.
fn longest(mut all: Vec<Result<Log, LogError>>) -> Result<Log, LogError> {
    if all.len() == 1 {
        return all.swap_remove(0);
    }
    let said: Vec<String> = all.iter().map(said_of).collect();
    let flown = |log: &Result<Log, LogError>| log.as_ref().map_or(-1.0, Log::flown_s);
    let best = (0..all.len()).rev().max_by(|a, b| flown(&all[*a]).total_cmp(&flown(&all[*b])));
    let best = best.unwrap_or(0);
    let mut log = all.swap_remove(best)?;
    if said.len() > 1 {
        let others: Vec<&str> =
            said.iter().enumerate().filter(|(k, _)| *k != best).map(|(_, s)| s.as_str()).collect();
        log.findings.push(Finding::warning(format!(
            "the file holds {} flights; this is {}, the longest; the others: {}",
            said.len(),
            said[best],
            others.join("; ")
        )));
    }
    Ok(log)
}

type Lives = Vec<Result<Log, LogError>>;

fn open(path: &Path, options: &Options, to: Use) -> Result<Lives, LogError> {
    let failed = |source| LogError::File { path: path.to_owned(), source };
    let (file, part) = door::part(path);
    let opened = Opened::file(&file).map_err(failed)?;
    let start = opened.start.clone();
    let mut all = read(&start, &mut opened.reader(), &file, options, to)?;
    let Some(number) = part else { return Ok(all) };
    if number > all.len() {
        return Err(LogError::Part { path: file, asked: number, there: all.len() });
    }
    Ok(vec![all.swap_remove(number - 1)])
}

/// Size of the read buffer for tables, bytes.
const BUFFER: usize = 64 * 1024;

/// Message for a file of unknown format.
const NONE_OF_THEM: &str = "it begins neither like a CSV table nor a PX4 ULog, an ArduPilot DataFlash .bin or .log, a MAVLink .tlog, or a ROS 2 bag (.mcap)";

/// Reads the flights of the log `source`, whose first bytes are `start`.
fn read(
    start: &[u8],
    source: &mut dyn Read,
    path: &Path,
    options: &Options,
    to: Use,
) -> Result<Lives, LogError> {
    if start.is_empty() {
        return Err(LogError::Empty { path: path.to_owned() });
    }
    let narrowed = door::narrowed(start);
    let Some(format) = Format::of(narrowed.as_deref().unwrap_or(start)) else {
        let what = foreign::kind(start).unwrap_or(NONE_OF_THEM);
        return Err(LogError::Foreign { path: path.to_owned(), what });
    };
    // columns that are computed from other columns need every row
    let keep = match to {
        Use::Look if !options.mapping.derives() => Keep::Stretches,
        _ => Keep::All,
    };
    if format == Format::Csv {
        return table(start, source, path, options, to, keep);
    }
    let lives = decoded(format, start, source, path, options, keep)?;
    let several = lives.len() > 1;
    let one = |(k, mut topics): (usize, Topics)| {
        topics.align();
        let name = if several { format!("{}#{}", name(path), k + 1) } else { name(path) };
        binary::read(format, topics, &name, path, options, to)
    };
    Ok(lives.into_iter().enumerate().map(one).collect())
}

/// Decodes the topics of each flight of a log that is not a CSV table.
fn decoded(
    format: Format,
    start: &[u8],
    mut source: &mut dyn Read,
    path: &Path,
    options: &Options,
    keep: Keep,
) -> Result<Vec<Topics>, LogError> {
    let failed = |source| LogError::File { path: path.to_owned(), source };
    let wanted = |topic: &str| options.mapping.wants(format, topic);
    let fields = |topic: &str, field: &str| options.mapping.wants_field(format, topic, field);
    let narrow;
    let mut narrowed;
    let mut text_log;
    let (lives, window): (Vec<Topics>, _) = match format {
        Format::Ulog => {
            let (topics, window) = ulog::read(&mut source, &fields, keep);
            (vec![topics], window)
        }
        Format::Dataflash if door::is_wide(start) => {
            narrow = decode(source).map_err(failed)?;
            narrowed = &narrow[..];
            text_log = Binary::new(&mut narrowed);
            dataflash::read(&mut text_log, &wanted, keep)
        }
        Format::Dataflash if !start.starts_with(&DATAFLASH_MAGIC) => {
            text_log = Binary::new(&mut source);
            dataflash::read(&mut text_log, &wanted, keep)
        }
        Format::Dataflash => dataflash::read(&mut source, &wanted, keep),
        #[cfg(feature = "ros")]
        Format::Ros => super::ros::read(&mut source, &fields, keep),
        #[cfg(not(feature = "ros"))]
        Format::Ros => {
            let (path, what) = (path.to_owned(), foreign::BAG_WITHOUT_READER);
            return Err(LogError::Foreign { path, what });
        }
        _ => tlog::read(&mut source, &wanted),
    };
    if let Some(error) = window.failure() {
        return Err(failed(error));
    }
    if format == Format::Dataflash && lives.iter().all(Topics::of_sdlog2) {
        return Err(LogError::Foreign { path: path.to_owned(), what: foreign::SDLOG2 });
    }
    Ok(lives)
}

/// Reads the flights of a CSV table.
fn table(
    start: &[u8],
    source: &mut dyn Read,
    path: &Path,
    options: &Options,
    to: Use,
    keep: Keep,
) -> Result<Lives, LogError> {
    if !door::is_wide(start) {
        return text::read(&mut BufReader::with_capacity(BUFFER, source), path, options, to, keep);
    }
    let failed = |source| LogError::File { path: path.to_owned(), source };
    let bytes = decode(source).map_err(failed)?;
    text::read(&mut &bytes[..], path, options, to, keep)
}

/// Reads the UTF-16 text `source` and returns it in UTF-8.
fn decode(source: &mut dyn Read) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.read_to_end(&mut bytes)?;
    Ok(door::narrowed(&bytes).unwrap_or(bytes))
}

/// The name of the file without its folders.
pub(super) fn name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Text on units that are probably wrong, for the error about unusable rows. It consists of the findings whose text contains
/// "look", such as "looks like degrees". The texts of `screening` must therefore keep this word.
pub(super) fn hint(findings: &[Finding]) -> String {
    findings.iter().filter(|f| f.text.contains("look")).map(|f| format!("; {}", f.text)).collect()
}

/// Finding about `count` dropped rows, of which `numbers` are the first; `None` if no row was dropped.
pub(super) fn dropped(count: usize, numbers: &[usize]) -> Option<Finding> {
    let list = numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    let more = if count > numbers.len() { " …" } else { "" };
    (count > 0).then(|| {
        Finding::warning(format!(
            "{count} rows dropped as out of order, repeated, incomplete or impossible (rows {list}{more})"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dataflash_text_in_utf_16_is_read_as_in_utf_8() {
        let text = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
            FMT, 7, 15, ATT, Qf, TimeUS,Roll\nATT, 1000000, 1.5\nATT, 1020000, 1.6\n";
        let wide: Vec<u8> = "\u{feff}"
            .encode_utf16()
            .chain(text.encode_utf16())
            .flat_map(u16::to_le_bytes)
            .collect();
        let lacks = |bytes: &[u8]| {
            parse(bytes, Path::new("a.log"), &Options::default()).unwrap_err().to_string()
        };
        let said = lacks(text.as_bytes());
        assert!(said.contains("the file holds ATT"), "{said}");
        assert_eq!(lacks(&wide), said);
    }
}
