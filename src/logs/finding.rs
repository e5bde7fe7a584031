//! Findings: defects and peculiarities of a log, which are reported to the user.

use std::collections::BTreeMap;

use serde::Serialize;

use super::format::Format;
use super::mapping::{Entry, TEXT};

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// For information; the log can be used fully.
    Note,
    /// Part of the log cannot be used.
    Warning,
    /// Results computed from the log would be wrong.
    Problem,
}

/// A factor, and for some columns a constant, that correct a column, or the exchange of two columns. The `Display` text has the
/// entries for a mapping file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cure {
    /// Name of the column to be corrected.
    pub column: String,
    /// Factor by which the column is multiplied.
    pub scale: f64,
    /// Constant that is added to the multiplied column, in the column's unit.
    #[serde(skip_serializing_if = "is_zero")]
    pub offset: f64,
    /// The other column, if two columns are to be exchanged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exchanged_with: Option<String>,
}

fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// A quarter of a turn, rad, with the digits of a mapping file.
#[expect(clippy::approx_constant, reason = "the user reads it in a mapping line")]
pub(crate) const QUARTER_TURN: f64 = 1.5708;

/// Groups of columns with a common unit. A finding about a wrong unit names the first column of its group.
const ALIKE: [[&str; 3]; 3] = [
    ["roll_rad", "pitch_rad", "yaw_rad"],
    ["p_radps", "q_radps", "r_radps"],
    ["ax_mps2", "ay_mps2", "az_mps2"],
];

impl Cure {
    /// The correction that multiplies `column` by `scale`.
    pub fn factor(column: impl Into<String>, scale: f64) -> Cure {
        Cure { column: column.into(), scale, offset: 0.0, exchanged_with: None }
    }

    /// The correction that exchanges `column` and `other`.
    pub fn exchange(column: impl Into<String>, other: impl Into<String>) -> Cure {
        Cure { exchanged_with: Some(other.into()), ..Cure::factor(column, 1.0) }
    }

    /// The line of a mapping file that makes the correction in a CSV table; two lines for an exchange.
    pub fn line(&self) -> String {
        let entry = |column: &str| (column.to_owned(), Entry::scaled(TEXT, column, 1.0));
        let entries: BTreeMap<String, Entry> = self.columns().into_iter().map(entry).collect();
        self.line_of(&entries, Format::Csv).unwrap_or_default()
    }

    /// The line of a mapping file that makes the correction in a log of `format`, whose columns `entries` fill. `None` if an entry is
    /// missing.
    fn line_of(&self, entries: &BTreeMap<String, Entry>, format: Format) -> Option<String> {
        let line = |column: &str, from: &str| {
            let entry = entries.get(from)?;
            Some(format!("{column} = {}", entry.corrected(self.scale, self.offset, format)))
        };
        let column = self.column.as_str();
        match self.exchanged_with.as_deref() {
            None => line(column, column),
            Some(other) => Some(format!("{} and {}", line(column, other)?, line(other, column)?)),
        }
    }

    /// The columns that are corrected, each with the column whose field fills it from then on.
    pub fn sources(&self) -> Vec<(&str, &str)> {
        let column = self.column.as_str();
        match self.exchanged_with.as_deref() {
            Some(other) => vec![(column, other), (other, column)],
            None => self.columns().into_iter().map(|column| (column, column)).collect(),
        }
    }

    /// The columns that are corrected: the column itself, and one that is exchanged with it. If its unit is wrong, the unit of its
    /// whole group is.
    pub fn columns(&self) -> Vec<&str> {
        if let Some(other) = &self.exchanged_with {
            return vec![self.column.as_str(), other.as_str()];
        }
        let group = ALIKE.iter().find(|group| group[0] == self.column && self.scale > 0.0);
        group.map_or_else(|| vec![self.column.as_str()], |group| group.to_vec())
    }
}

impl std::fmt::Display for Cure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "read it with --mapping FILE, in which [columns] has {} (in a binary log its topic and field stand in place of {TEXT}.{})",
            self.line(),
            self.column
        )
    }
}

/// A defect or peculiarity of a log, which is reported to the user.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// How much the finding matters.
    pub severity: Severity,
    /// Description of the finding, with a remedy.
    pub text: String,
    /// The correction of the defect; `None` if the log shows none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cure: Option<Cure>,
    /// Possible corrections, if the log does not show which of them is right; otherwise empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<Cure>,
}

impl Finding {
    /// A finding of severity [`Severity::Note`].
    pub fn note(text: impl Into<String>) -> Self {
        Finding::of(Severity::Note, text.into())
    }
    /// A finding of severity [`Severity::Warning`].
    pub fn warning(text: impl Into<String>) -> Self {
        Finding::of(Severity::Warning, text.into())
    }
    /// A finding of severity [`Severity::Problem`].
    pub fn problem(text: impl Into<String>) -> Self {
        Finding::of(Severity::Problem, text.into())
    }

    fn of(severity: Severity, text: String) -> Self {
        Finding { severity, text, cure: None, choices: Vec::new() }
    }

    /// Whether the finding proposes a correction of `column`, or several possible ones.
    pub fn corrects(&self, column: &str) -> bool {
        self.cure.iter().chain(&self.choices).any(|cure| cure.columns().contains(&column))
    }
}

impl Finding {
    /// The finding with `more` appended to its text.
    pub fn with(self, more: &str) -> Self {
        Finding { text: self.text + more, ..self }
    }
}

/// Whether the factor `gain` converts degrees into radians, apart from the sign.
fn near_degree(gain: f64) -> bool {
    (gain.abs() / 1_f64.to_radians() - 1.0).abs() < 0.01
}

/// Adapts the correction that `finding` proposes to the log. `entries` has the entry of a mapping file for each column that a
/// single field fills. The text then has the whole entry: the field, and the reader's own factor times the correction. A column
/// that has no entry cannot be corrected by a factor.
pub(super) fn named(
    finding: Finding,
    entries: &BTreeMap<String, Entry>,
    format: Format,
) -> Finding {
    let Some(cure) = &finding.cure else { return choices_named(finding, entries, format) };
    let (Cure { column, scale, .. }, said) = (cure, cure.to_string());
    let several = match &cure.exchanged_with {
        Some(other) => format!(
            "{column} or {other} is computed from several fields, so that no mapping exchanges them: name other fields in a mapping (--mapping)"
        ),
        None => format!(
            "{column} is computed from several fields or from servo pulses, so that no factor in a mapping corrects it: state what the outputs drive in [surfaces] of an airframe file (--airframe), or name another field in a mapping (--mapping)"
        ),
    };
    let (Some(entry), Some(line)) = (entries.get(column), cure.line_of(entries, format)) else {
        return Finding { text: finding.text.replace(&said, &several), cure: None, ..finding };
    };
    if near_degree(entry.scale) && near_degree(*scale) {
        return Finding::warning(format!(
            "{column} is beyond 57° for more than a twentieth of the flight ({}.{}, which the reader takes for degrees): no flow that a model of an aircraft on its wings describes",
            entry.topic, entry.field
        ));
    }
    let better = format!("read it with --mapping FILE, in which [columns] has {line}");
    Finding { text: finding.text.replace(&said, &better), ..finding }
}

/// Adapts the possible corrections of `finding` to the log, as [`named`] does for a single one.
fn choices_named(finding: Finding, entries: &BTreeMap<String, Entry>, format: Format) -> Finding {
    let better = |cure: &Cure| {
        let line = cure.line_of(entries, format);
        line.unwrap_or_else(|| format!("{} times {}", cure.column, cure.scale))
    };
    let text = finding
        .choices
        .iter()
        .fold(finding.text.clone(), |text, cure| text.replace(&cure.line(), &better(cure)));
    Finding { text, ..finding }
}

impl Severity {
    fn word(self) -> &'static str {
        match self {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Problem => "problem",
        }
    }
}

impl Finding {
    /// The text with the name of its log, as one of the notes of a result. Only a warning or a problem begins with its severity.
    pub fn noted(&self, log: &str) -> String {
        match self.severity {
            Severity::Note => format!("{log}: {}", self.text),
            severity => format!("{}: {log}: {}", severity.word(), self.text),
        }
    }
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.severity.word(), self.text)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::mapping::Mapping;

    #[test]
    fn a_cure_of_a_log_has_its_field_with_the_readers_own_factor() {
        let cure = Cure::factor("elevator_cmd", -1.0);
        let found =
            Finding { cure: Some(cure.clone()), ..Finding::problem(format!("turned: {cure}")) };
        let entry = Entry {
            offset: 0.25,
            instance: Some(0x0102),
            ..Entry::scaled("MANUAL_CONTROL", "x", -0.001)
        };
        for format in [Format::Ulog, Format::Tlog] {
            let entries = BTreeMap::from([("elevator_cmd".to_owned(), entry.clone())]);
            let said = named(found.clone(), &entries, format).text;
            let (_, line) = said.split_once("[columns] has ").unwrap();
            let text = format!("schema = 1\n[columns]\n{line}\n");
            let mapping = Mapping::parse(&text, Path::new("m.toml")).unwrap();
            let right = Entry { scale: 0.001, offset: -0.25, ..entry.clone() };
            assert_eq!(mapping.get("elevator_cmd"), Some(&right), "{text}");
        }
        let computed = named(found, &BTreeMap::new(), Format::Ulog);
        assert!(computed.cure.is_none() && computed.text.contains("--airframe"), "{computed}");
    }

    #[test]
    fn each_choice_has_the_field_of_the_log() {
        let yaw = Cure { offset: QUARTER_TURN, ..Cure::factor("yaw_rad", -1.0) };
        let choices = vec![yaw, Cure::factor("r_radps", -1.0)];
        let lines: Vec<String> = choices.iter().map(Cure::line).collect();
        let found = Finding { choices, ..Finding::problem(lines.join(", or ")) };
        assert!(found.corrects("r_radps") && !found.corrects("p_radps"));
        let entry = Entry { offset: 0.5, ..Entry::scaled("ATT", "Yaw", 0.0174533) };
        let entries = BTreeMap::from([("yaw_rad".to_owned(), entry)]);
        let said = named(found, &entries, Format::Dataflash).text;
        let line = "yaw_rad = { from = \"ATT.Yaw\", scale = -0.0174533, offset = 1.0708 }";
        assert!(said.starts_with(line) && said.ends_with("r_radps times -1"), "{said}");
    }

    #[test]
    fn the_sentence_of_a_cure_holds_a_line_of_a_mapping() {
        let cure = Cure::factor("airspeed_mps", 0.514444);
        let said = cure.to_string();
        let (_, line) = said.split_once("[columns] has ").unwrap();
        let (line, _) = line.split_once('}').unwrap();
        let text = format!("schema = 1\n[columns]\n{line}}}\n");
        let mapping = Mapping::parse(&text, Path::new("m.toml")).unwrap();
        assert!(mapping.get("airspeed_mps").is_some(), "{text}");
        assert!(line.contains("scale = 0.514444"), "{line}");
    }
}
