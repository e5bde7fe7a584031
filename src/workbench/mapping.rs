//! The mapping of a workbench session: factors that correct wrong units or signs of logs.

use std::fs;
use std::path::PathBuf;

use super::bench::{Bench, Inner};
use super::error::{WorkbenchError, io};
use super::session::Role;
use greylag_logs::finding::Cure;
use greylag_logs::mapping::Entry;
use greylag_report::write_over;

/// Name of the mapping file in the session's folder.
pub(super) const FILE: &str = "mapping.toml";

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or(value.as_integer().map(|n| n as f64))
}

/// Adds the entry `read` for a column to the mapping `text`, unless the column has one already, and multiplies its factor by
/// `scale`. `None` if `text` is not a mapping.
fn with_column(text: &str, column: &str, read: &str, scale: f64) -> Option<String> {
    let mut table: toml::Table = toml::from_str(text).ok()?;
    table.insert("schema".into(), 1.into());
    let columns = table.entry("columns").or_insert(toml::Table::new().into()).as_table_mut()?;
    let read: toml::Table = toml::from_str(&format!("entry = {read}")).ok()?;
    let given = columns.get(column).or(read.get("entry"));
    let mut entry = given?.as_table()?.clone();
    let before = entry.get("scale").and_then(number).unwrap_or(1.0);
    entry.insert("scale".into(), (before * scale).into());
    // the offset is added after the scale
    if let Some(offset) = entry.get("offset").and_then(number) {
        entry.insert("offset".into(), (offset * scale).into());
    }
    columns.insert(column.into(), entry.into());
    toml::to_string(&table).ok()
}

impl Bench {
    /// Adds a factor for a column, or for all columns with its unit, to the session's mapping, and reads all logs again.
    pub(super) fn map(
        &self,
        seen: u64,
        place: usize,
        column: &str,
        scale: f64,
    ) -> Result<(), WorkbenchError> {
        let path: PathBuf = self.folder.join(FILE);
        let mut replaced = None;
        let mapped = self.change(seen, |inner| {
            let before = inner.mapping.text.clone();
            inner.map(place, column, scale)?;
            // the file is written last, because the next start of the workbench reads it
            replaced = Some(before);
            Ok(write_over(&path, &inner.mapping.text)?)
        });
        mapped.inspect_err(|_| {
            let _ = match replaced.as_deref() {
                None => Ok(()),
                Some("") => fs::remove_file(&path).map_err(|e| io(&path, e)),
                Some(text) => write_over(&path, text).map_err(Into::into),
            };
        })
    }
}

impl Inner {
    /// Reads the logs again with one more factor. Logs that still have problems get the role of unused flights, unless the user
    /// wants such logs (`--despite-problems`). The log at `place` gets its default role again if its problems are corrected.
    fn map(&mut self, place: usize, column: &str, scale: f64) -> Result<(), WorkbenchError> {
        let path = self.folder.join(FILE);
        let flight = self.flights.get(place).and_then(|f| f.as_ref().ok());
        let info = &flight.ok_or(WorkbenchError::NoFlight(place))?.info;
        if !info.entries.contains_key(column) {
            return Err(WorkbenchError::Computed(column.to_owned()));
        }
        let cure = Cure::factor(column, scale);
        let entries = cure.columns().into_iter().filter_map(|c| Some((c, info.entries.get(c)?)));
        let entries: Vec<_> = entries.collect();
        if self.given.mapping.is_some() {
            let line =
                |(c, entry): &(&str, &Entry)| format!("{c} = {}", entry.times(scale, info.format));
            let lines: Vec<String> = entries.iter().map(line).collect();
            return Err(WorkbenchError::MappingGiven(lines.join("\n")));
        }
        let text = entries.iter().try_fold(self.mapping.text.clone(), |text, (c, entry)| {
            with_column(&text, c, &entry.times(1.0, info.format), scale)
        });
        self.read_by(&path, text.ok_or_else(|| WorkbenchError::NoMapping(path.clone()))?)?;
        self.reread();
        let all = self.flights.iter().enumerate().filter(|_| !self.given.despite_problems);
        let doubtful = all.filter(|(_, flight)| flight.as_ref().is_ok_and(|f| f.in_doubt()));
        for k in doubtful.map(|(k, _)| k).collect::<Vec<_>>() {
            self.give_role(k, Role::Unused)?;
        }
        let right = self.flights[place].as_ref().is_ok_and(|f| !f.in_doubt());
        if right && self.session.logs[place].role == Role::Unused {
            let usual = self.session.usual_role(&self.session.logs[place].name());
            self.give_role(place, usual)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_that_is_mapped_already_is_scaled_once_more() {
        let once = with_column("", "az_mps2", "{ from = \"csv.az_mps2\" }", -1.0).unwrap();
        let twice = with_column(&once, "az_mps2", "{ from = \"csv.az_mps2\" }", 9.80665).unwrap();
        let both = with_column(&twice, "p_radps", "{ from = \"csv.p_radps\" }", 0.0174533).unwrap();
        let read: toml::Table = toml::from_str(&both).unwrap();
        assert_eq!(read["columns"]["az_mps2"]["scale"].as_float(), Some(-9.80665));
        assert_eq!(read["columns"]["p_radps"]["from"].as_str(), Some("csv.p_radps"));
        assert_eq!(read["schema"].as_integer(), Some(1));
    }

    #[test]
    fn the_field_and_the_offset_of_a_mapped_column_are_kept() {
        let mapped =
            "[columns]\naz_mps2 = { from = \"imu.az\", offset = 2.0, rate_over_s = 0.1 }\n";
        let scaled = with_column(mapped, "az_mps2", "{ from = \"csv.az_mps2\" }", -1.0).unwrap();
        let read: toml::Table = toml::from_str(&scaled).unwrap();
        let entry = &read["columns"]["az_mps2"];
        assert_eq!(entry["from"].as_str(), Some("imu.az"));
        assert_eq!(entry["scale"].as_float(), Some(-1.0));
        assert_eq!(entry["offset"].as_float(), Some(-2.0));
        assert_eq!(entry["rate_over_s"].as_float(), Some(0.1));
    }
}
