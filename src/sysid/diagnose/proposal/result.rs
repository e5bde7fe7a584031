//! The result of a search for a formula, serialized to JSON (`greylag.proposal/1`).

use serde::Serialize;

use crate::diagnose::Verdict;

/// Properties of the formula's first term that are certain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Grades {
    /// Whether the channel in which the term acts is certain.
    pub channel: bool,
    /// Whether the variables on which it depends are certain.
    pub variables: bool,
    /// Whether its trend with these variables (odd, even, monotonic) is certain.
    pub trend: bool,
    /// Whether the form is certain, up to its constants.
    pub form: bool,
}

/// A form that the flights cannot distinguish from the first term.
#[derive(Clone, Debug, Serialize)]
pub struct Alternative {
    /// Formula, as text.
    pub formula: String,
    /// Evidence of the form.
    pub evidence: f64,
}

/// A step of the search: the formula with one more term.
#[derive(Clone, Debug, Serialize)]
pub struct Rung {
    /// Formula, as text.
    pub formula: String,
    /// Number of variables, numbers and operations in it, its coefficients included.
    pub complexity: usize,
    /// Share of the error beyond noise in the searched channels that the formula removes.
    pub removed: f64,
    /// Evidence of its last term.
    pub evidence: f64,
    /// Evidence that chance reaches in the same search over null flights.
    pub threshold: f64,
    /// Whether this formula is the chosen one.
    pub chosen: bool,
}

/// Test of the chosen formula on held-out flights, with its coefficients as found.
#[derive(Clone, Debug, Serialize)]
pub struct HeldOut {
    /// Names of the flights.
    pub flights: Vec<String>,
    /// Share of the error beyond noise in its channels that the formula removes.
    pub removed: f64,
    /// Reduction of the squared error, in units of the noise's variance.
    pub fall: f64,
    /// Reduction that chance reaches.
    pub threshold: f64,
}

/// Result of the search over free forms, made if the library's shapes do not suffice.
#[derive(Clone, Debug, Serialize)]
pub struct FreeForms {
    /// Reason for the search.
    pub why: String,
    /// Number of forms evaluated, over all channels.
    pub tried: usize,
    /// The best form of each size that removes more than all smaller ones, by channel, with fitted constants.
    pub front: Vec<Rung>,
    /// Whether one of them is part of the formula found.
    pub chosen: bool,
}

/// Settings of a search for a formula.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Seed of all random draws.
    pub seed: u64,
    /// Number of bootstrap draws under the null hypothesis, which determine the thresholds.
    pub nulls: usize,
    /// Ids excluded from the catalogue.
    pub without: Vec<String>,
    /// Whether free forms may be tried.
    pub free_forms: bool,
}

/// The result of a search for a formula.
#[derive(Clone, Debug, Serialize)]
pub struct Proposal {
    /// Schema of the document, `greylag.proposal/1`.
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the model.
    pub model: String,
    /// Verdict of the preceding diagnosis.
    pub verdict: Verdict,
    /// The answer in plain sentences.
    pub sentences: Vec<String>,
    /// Formulas of the search, each with one more term than the one before.
    pub front: Vec<Rung>,
    /// The search of free forms, if one was made.
    pub free: Option<FreeForms>,
    /// Forms that these flights cannot distinguish from the first term.
    pub alike: Vec<Alternative>,
    /// Properties of the first term that are certain.
    pub grades: Option<Grades>,
    /// Test on held-out flights.
    pub held_out: Option<HeldOut>,
    /// Number of the library's shapes evaluated, lagged controls included.
    pub tried: usize,
    /// Reasons not to propose the formula found; empty if it is proposed.
    pub refused: Vec<String>,
    /// Settings of the search.
    pub settings: Settings,
    /// Best evidence over all forms in each null flight.
    pub nulls: Vec<f64>,
    /// The effect file, if one is proposed.
    pub effect: Option<String>,
    /// Further notes for the reader.
    pub notes: Vec<String>,
}
