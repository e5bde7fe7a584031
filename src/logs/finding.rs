//! Findings: defects and peculiarities of a log, which are reported to the user.

use serde::Serialize;

use super::mapping::TEXT;

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

/// A factor that corrects a column. Its `Display` text is the entry for a mapping file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cure {
    /// Name of the column to be corrected.
    pub column: String,
    /// Factor by which the column is multiplied.
    pub scale: f64,
}

impl std::fmt::Display for Cure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Cure { column, scale } = self;
        write!(
            f,
            "read it with --mapping FILE, in which [columns] has {column} = {{ from = \"{TEXT}.{column}\", scale = {scale} }} (in a binary log its topic and field stand in place of {TEXT}.{column})"
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
    /// The column and the factor that correct the defect; `None` if no factor can.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cure: Option<Cure>,
}

impl Finding {
    /// A finding of severity [`Severity::Note`].
    pub fn note(text: impl Into<String>) -> Self {
        Finding { severity: Severity::Note, text: text.into(), cure: None }
    }
    /// A finding of severity [`Severity::Warning`].
    pub fn warning(text: impl Into<String>) -> Self {
        Finding { severity: Severity::Warning, text: text.into(), cure: None }
    }
    /// A finding of severity [`Severity::Problem`].
    pub fn problem(text: impl Into<String>) -> Self {
        Finding { severity: Severity::Problem, text: text.into(), cure: None }
    }
}

impl Finding {
    /// The finding with `more` appended to its text.
    pub fn with(self, more: &str) -> Self {
        Finding { text: self.text + more, ..self }
    }
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let word = match self.severity {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Problem => "problem",
        };
        write!(f, "{word}: {}", self.text)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::mapping::Mapping;

    #[test]
    fn the_sentence_of_a_cure_holds_a_line_of_a_mapping() {
        let cure = Cure { column: "airspeed_mps".into(), scale: 0.514444 };
        let said = cure.to_string();
        let (_, line) = said.split_once("[columns] has ").unwrap();
        let (line, _) = line.split_once('}').unwrap();
        let text = format!("schema = 1\n[columns]\n{line}}}\n");
        let mapping = Mapping::parse(&text, Path::new("m.toml")).unwrap();
        assert!(mapping.get("airspeed_mps").is_some(), "{text}");
        assert!(line.contains("scale = 0.514444"), "{line}");
    }
}
