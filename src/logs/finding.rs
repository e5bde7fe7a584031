//! Something about a log that its user should know.

use serde::Serialize;

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Good to know.
    Note,
    /// Some of the log cannot be used, or not fully.
    Warning,
    /// What is computed from the log would be wrong.
    Problem,
}

/// Something about a log that its user should know.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// What it is, with what would help.
    pub text: String,
}

impl Finding {
    /// A note.
    pub fn note(text: impl Into<String>) -> Self {
        Finding { severity: Severity::Note, text: text.into() }
    }
    /// A warning.
    pub fn warning(text: impl Into<String>) -> Self {
        Finding { severity: Severity::Warning, text: text.into() }
    }
    /// A problem.
    pub fn problem(text: impl Into<String>) -> Self {
        Finding { severity: Severity::Problem, text: text.into() }
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
