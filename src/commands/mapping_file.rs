//! Text of a mapping file: it multiplies columns of logs by factors that correct wrong units and signs.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use crate::logs::info::Info;
use crate::logs::quoted;

/// Least time in flight in which a log without a finding counts as one that needs no correction, s.
const ENOUGH_S: f64 = 5.0;

/// A flight of a log file, and the entries of a mapping file that correct its columns.
struct Wanted<'a> {
    path: &'a Path,
    info: &'a Info,
    entries: BTreeMap<String, String>,
}

impl<'a> Wanted<'a> {
    fn of((path, info): &'a (PathBuf, Info)) -> Self {
        let cures = || info.findings.iter().filter_map(|f| f.cure.as_ref());
        // a finding about a sign is reliable only if the units are right, so that wrong units are corrected first
        let units = cures().any(|cure| cure.scale > 0.0 && cure.exchanged_with.is_none());
        let mut entries = BTreeMap::new();
        for cure in cures().filter(|cure| !units || cure.scale > 0.0) {
            for (column, from) in cure.sources() {
                let entry = info.entries.get(from);
                let text = entry.map(|e| e.corrected(cure.scale, cure.offset, info.format));
                entries.extend(text.map(|text| (column.to_owned(), text)));
            }
        }
        Wanted { path, info, entries }
    }

    /// Whether the log has the column, flies for long enough, and has no problem in the column.
    fn is_right_in(&self, column: &str) -> bool {
        let Info { entries, flight_s, findings, .. } = self.info;
        entries.contains_key(column)
            && *flight_s >= ENOUGH_S
            && !findings.iter().any(|f| f.corrects(column))
    }
}

/// The mapping that corrects the findings about the flights `logs`, each with the path of its file; `None` if there is no
/// correction.
///
/// # Errors
/// If two files need different corrections of a column, or one needs a correction of a column that is right in another.
pub fn mapping(logs: &[(PathBuf, Info)]) -> Result<Option<String>> {
    let all: Vec<Wanted> = logs.iter().map(Wanted::of).collect();
    let columns: BTreeMap<&String, &String> = all.iter().flat_map(|w| &w.entries).collect();
    for column in columns.keys() {
        agree(&all, column)?;
    }
    let mut text = "schema = 1\n\n[columns]\n".to_owned();
    for (column, entry) in &columns {
        let _ = writeln!(text, "{column} = {entry}");
    }
    Ok((!columns.is_empty()).then_some(text))
}

/// Fails if one correction of `column` does not serve all of the files.
fn agree(all: &[Wanted], column: &str) -> Result<()> {
    let mut said: Vec<(&Path, &str)> = Vec::new();
    for one in all.iter().filter(|w| w.entries.contains_key(column)) {
        let entry = one.entries[column].as_str();
        if !said.contains(&(one.path, entry)) {
            said.push((one.path, entry));
        }
    }
    let right = all.iter().filter(|w| w.is_right_in(column));
    for one in right {
        if !said.iter().any(|(path, _)| *path == one.path) {
            said.push((one.path, "none"));
        }
    }
    let Some((bad, first)) = said.first().copied() else { return Ok(()) };
    if said.iter().all(|(_, entry)| *entry == first) {
        return Ok(());
    }
    let list: Vec<String> =
        said.iter().map(|(path, entry)| format!("{} {entry}", quoted(path))).collect();
    bail!(
        "the logs need different corrections of {column}, so no mapping was written: {}\n  {}",
        list.join("; "),
        converted(bad)
    )
}

/// The remedy for one of several logs, which a mapping for all of them would spoil: a table with right units and signs in place of
/// the log at `path`.
pub fn converted(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().replace('#', "-");
    let (mapping, table) = (format!("{stem}.toml"), format!("{stem}-corrected.csv"));
    let [log, mapping, table] = [path, Path::new(&mapping), Path::new(&table)].map(quoted);
    format!(
        "to put each log right alone: greylag logs info {log} --write-mapping {mapping}\n  \
         then: greylag logs convert {log} {table} --mapping {mapping}, and use {table} in place of {log}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logs::finding::{Cure, Finding};
    use crate::logs::{Options, parse};

    /// The summary of a log of `seconds` s with one finding about the accelerometers for each factor.
    fn log(name: &str, seconds: u32, scales: &[f64]) -> (PathBuf, Info) {
        let mut table = String::from(
            "time_s,roll_rad,pitch_rad,p_radps,q_radps,r_radps,airspeed_mps,aileron_rad,elevator_rad,throttle,ax_mps2,ay_mps2,az_mps2\n",
        );
        for k in 0..100 * seconds {
            let (time, x) = (0.01 * f64::from(k), 0.1 * (0.1 * f64::from(k)).sin());
            let _ = writeln!(
                table,
                "{time:.2},{x},{x},{x},{x},{x},{},{x},{x},0.5,{x},{x},-1",
                15.0 + x
            );
        }
        let log = parse(table.as_bytes(), Path::new(name), &Options::default()).unwrap();
        let cured = |scale: &f64| Finding {
            cure: Some(Cure::factor("ax_mps2", *scale)),
            ..Finding::problem("in another unit")
        };
        let findings = scales.iter().map(cured).collect();
        (name.into(), Info { findings, ..Info::of(&log) })
    }

    #[test]
    fn a_wrong_unit_is_corrected_in_all_columns_that_have_it() {
        let text = mapping(&[log("g.csv", 1, &[9.80665])]).unwrap().unwrap();
        for column in ["ax_mps2", "ay_mps2", "az_mps2"] {
            let line = format!("{column} = {{ from = \"csv.{column}\", scale = 9.80665 }}");
            assert!(text.contains(&line), "{text}");
        }
    }

    #[test]
    fn exchanged_columns_are_read_from_each_others_fields() {
        let (path, info) = log("g.csv", 1, &[]);
        let cure = Some(Cure::exchange("ax_mps2", "ay_mps2"));
        let findings = vec![Finding { cure, ..Finding::problem("exchanged") }];
        let text = mapping(&[(path, Info { findings, ..info })]).unwrap().unwrap();
        for (column, from) in [("ax_mps2", "ay_mps2"), ("ay_mps2", "ax_mps2")] {
            let line = format!("{column} = {{ from = \"csv.{from}\", scale = 1 }}");
            assert!(text.contains(&line), "{text}");
        }
    }

    #[test]
    fn a_correction_that_does_not_serve_all_logs_is_not_written() {
        let bad = log("g.csv", 10, &[9.80665]);
        let said = |other| mapping(&[bad.clone(), other]).map_err(|e| e.to_string());
        let milli = said(log("my mg.csv", 10, &[0.00980665])).unwrap_err();
        assert!(milli.contains("g.csv { from") && milli.contains("'my mg.csv' {"), "{milli}");
        assert!(milli.contains("logs convert g.csv g-corrected.csv --mapping g.toml"), "{milli}");
        let right = said(log("right.csv", 10, &[])).unwrap_err();
        assert!(right.contains("right.csv none"), "{right}");
        // a log that is too short to show a wrong unit, and one with the same unit, take the same mapping
        for other in [log("short.csv", 1, &[]), log("same.csv", 10, &[9.80665])] {
            assert!(said(other).unwrap().is_some());
        }
    }
}
