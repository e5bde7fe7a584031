//! The mapping that the session writes where a log's units or signs are wrong.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::bench::{Bench, Inner};
use super::error::WorkbenchError;
use super::flights::Loaded;
use super::session::Role;
use crate::logs::Format;
use crate::logs::finding::Finding;
use crate::logs::mapping::{Mapping, TEXT};
use crate::report::write_over;

/// The file in the session's folder.
const FILE: &str = "mapping.toml";
/// The option that names it on a command line.
const OPTION: &str = " --mapping ";

/// What would put a column right.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cure {
    /// The column.
    pub column: String,
    /// The factor.
    pub scale: f64,
}

impl Cure {
    /// The cure that a finding names: the line of a mapping in its text.
    pub fn of(finding: &Finding) -> Option<Cure> {
        let (_, line) = finding.text.split_once("[columns] has ")?;
        let (line, _) = line.split_once('}')?;
        let table: toml::Table = toml::from_str(&format!("{line}}}")).ok()?;
        let (column, entry) = table.iter().next()?;
        // a turned axis needs more than a factor: its user writes that mapping
        if entry.get("offset").is_some() {
            return None;
        }
        Some(Cure { column: column.clone(), scale: number(entry.get("scale")?)? })
    }
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or(value.as_integer().map(|n| n as f64))
}

/// Where a column of a log comes from, as a mapping says it.
fn origin(flight: &Loaded, column: &str) -> String {
    let named = |c: &&crate::logs::Channel| c.columns.iter().any(|own| own == column);
    match (flight.info.format, flight.info.channels.iter().find(named)) {
        (Format::Csv, _) | (_, None) => format!("{TEXT}.{column}"),
        (_, Some(channel)) => channel.origin.clone(),
    }
}

/// The mapping `text` with one column more; a column that is there is scaled once more.
fn with_column(text: &str, column: &str, from: &str, scale: f64) -> Option<String> {
    let mut table: toml::Table = toml::from_str(text).ok()?;
    table.insert("schema".into(), 1.into());
    let columns = table.entry("columns").or_insert(toml::Table::new().into()).as_table_mut()?;
    let before = columns.get(column).and_then(|c| number(c.get("scale")?)).unwrap_or(1.0);
    let mut entry = toml::Table::new();
    entry.insert("from".into(), from.into());
    entry.insert("scale".into(), (before * scale).into());
    columns.insert(column.into(), entry.into());
    toml::to_string(&table).ok()
}

impl Inner {
    /// Takes up the session's mapping, if it has one and none was named besides.
    pub fn take_mapping(&mut self, folder: &Path) -> Result<(), WorkbenchError> {
        let path = folder.join(FILE);
        let own = format!("{OPTION}{}", path.display());
        if !path.exists() || (self.words.contains(OPTION) && !self.words.contains(&own)) {
            return Ok(());
        }
        self.reading.mapping = Mapping::load(&path)?;
        self.mapping = fs::read_to_string(&path).map_err(|e| super::error::io(&path, e))?;
        if !self.words.contains(&own) {
            self.words.push_str(&own);
        }
        Ok(())
    }

    /// Reads all logs again.
    pub fn reread(&mut self, folder: &Path) {
        let read = |entry: &super::session::LogEntry| {
            Loaded::read(entry, folder, &self.reading, &self.model).map_err(|e| e.to_string())
        };
        self.flights = self.session.logs.iter().map(read).collect();
    }
}

impl Bench {
    /// Writes a factor for a column into the session's mapping, and reads the logs again by it.
    pub(super) fn map(
        &self,
        seen: u64,
        place: usize,
        column: &str,
        scale: f64,
    ) -> Result<(), WorkbenchError> {
        let path: PathBuf = self.folder.join(FILE);
        self.change(seen, |inner| {
            let flight = inner.flights.get(place).and_then(|f| f.as_ref().ok());
            let from = origin(flight.ok_or(WorkbenchError::NoFlight(place))?, column);
            if inner.words.contains(OPTION) && inner.mapping.is_empty() {
                return Err(WorkbenchError::MappingGiven(format!(
                    "{column} = {{ from = \"{from}\", scale = {scale} }}"
                )));
            }
            let text = with_column(&inner.mapping, column, &from, scale);
            let text = text.ok_or_else(|| WorkbenchError::NoMapping(path.clone()))?;
            write_over(&path, &text)?;
            inner.take_mapping(&self.folder)?;
            inner.reread(&self.folder);
            let right = inner.flights[place].as_ref().is_ok_and(|f| !f.in_doubt());
            if right && inner.session.logs[place].role == Role::Unused {
                let name = inner.session.logs[place].name();
                inner.session.logs[place].role = inner.session.usual_role(&name);
            }
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cure_of_a_finding_is_its_line_of_a_mapping() {
        let text = "airspeed looks like knots: read it with --mapping FILE, in which [columns] has airspeed_mps = \
                    { from = \"csv.airspeed_mps\", scale = 0.514444 } (in a binary log …)";
        let cure = Cure::of(&Finding::problem(text)).unwrap();
        assert_eq!(cure, Cure { column: "airspeed_mps".into(), scale: 0.514444 });
        let sign =
            Finding::problem("[columns] has az_mps2 = { from = \"csv.az_mps2\", scale = -1 }");
        assert_eq!(Cure::of(&sign).unwrap().scale, -1.0);
        let turned =
            "[columns] has yaw_rad = { from = \"csv.yaw_rad\", scale = -1, offset = 1.5708 }";
        assert_eq!(Cure::of(&Finding::problem(turned)), None);
        assert_eq!(Cure::of(&Finding::problem("the log has no flight")), None);
    }

    #[test]
    fn a_column_that_is_mapped_already_is_scaled_once_more() {
        let once = with_column("", "az_mps2", "csv.az_mps2", -1.0).unwrap();
        let twice = with_column(&once, "az_mps2", "csv.az_mps2", 9.80665).unwrap();
        let both = with_column(&twice, "p_radps", "csv.p_radps", 0.0174533).unwrap();
        let read: toml::Table = toml::from_str(&both).unwrap();
        assert_eq!(read["columns"]["az_mps2"]["scale"].as_float(), Some(-9.80665));
        assert_eq!(read["columns"]["p_radps"]["from"].as_str(), Some("csv.p_radps"));
        assert_eq!(read["schema"].as_integer(), Some(1));
    }
}
