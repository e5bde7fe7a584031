//! What a search for a formula says, as it goes into JSON (`greylag.proposal/1`).

use serde::Serialize;

use crate::diagnose::Verdict;

/// What is sure of the form that was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Grades {
    /// The channel in which it acts.
    pub channel: bool,
    /// The variables on which it depends.
    pub variables: bool,
    /// Whether it is odd, even or only grows with them.
    pub trend: bool,
    /// The form, up to its constants.
    pub form: bool,
}

/// A form that the flights cannot tell from the one found.
#[derive(Clone, Debug, Serialize)]
pub struct Alternative {
    /// Its formula.
    pub formula: String,
    /// Its evidence.
    pub evidence: f64,
}

/// A step of the search: the formula with one term more.
#[derive(Clone, Debug, Serialize)]
pub struct Rung {
    /// Its formula.
    pub formula: String,
    /// Terms, numbers and operations in it.
    pub complexity: usize,
    /// Share of the error beyond noise in the failing channels that it removes.
    pub removed: f64,
    /// Evidence of its last term.
    pub evidence: f64,
    /// What chance reaches: of the search over all forms, on flights that lack nothing.
    pub threshold: f64,
    /// Whether it is the one proposed.
    pub chosen: bool,
}

/// What the chosen form does on flights that the search has not seen, its amounts as they were found.
#[derive(Clone, Debug, Serialize)]
pub struct HeldOut {
    /// Names of the flights.
    pub flights: Vec<String>,
    /// Share of the error beyond noise in its channels that it removes.
    pub removed: f64,
    /// The fall of the squared error over the noise's.
    pub fall: f64,
    /// What chance reaches.
    pub threshold: f64,
}

/// What the search of free forms gave, which follows where the library's shapes are not all.
#[derive(Clone, Debug, Serialize)]
pub struct FreeForms {
    /// Why it was made.
    pub why: String,
    /// Forms that were tried, over all channels.
    pub tried: usize,
    /// The best form of each size that takes more than all smaller ones, channel by channel, its constants fitted.
    pub front: Vec<Rung>,
    /// Whether one of them is in the formula that was found.
    pub chosen: bool,
}

/// What a search was asked for.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Seed of everything that is drawn.
    pub seed: u64,
    /// Bootstrap draws under the null hypothesis that set the thresholds.
    pub nulls: usize,
    /// Ids that were left out of the catalogue.
    pub without: Vec<String>,
    /// Whether free forms may be tried.
    pub free_forms: bool,
}

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub struct Proposal {
    /// `greylag.proposal/1`.
    pub schema: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// Name of the model.
    pub model: String,
    /// The verdict of the diagnosis before.
    pub verdict: Verdict,
    /// The answer in plain sentences.
    pub sentences: Vec<String>,
    /// The formulas of the search, each with one term more than the one before.
    pub front: Vec<Rung>,
    /// The search of free forms, if one was made.
    pub free: Option<FreeForms>,
    /// Forms of the first term that these flights cannot tell from it.
    pub alike: Vec<Alternative>,
    /// What is sure of the first term.
    pub grades: Option<Grades>,
    /// The test on other flights.
    pub held_out: Option<HeldOut>,
    /// Shapes of the library that were tried.
    pub tried: usize,
    /// Why the formula that was found is not proposed; empty if it is.
    pub refused: Vec<String>,
    /// What the search was asked for.
    pub settings: Settings,
    /// Best evidence in flights that lack nothing, over all forms.
    pub nulls: Vec<f64>,
    /// The effect file, if one is proposed.
    pub effect: Option<String>,
    /// What the reader must know besides.
    pub notes: Vec<String>,
}
