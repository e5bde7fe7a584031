//! The result of a search for a formula, serialized to JSON (`greylag.proposal/1`).
//!
//! The formula describes an effect (a physical contribution to forces and moments) that the model lacks. It is a sum of terms,
//! each of which acts in one channel (component of force or moment). The terms are chosen from the forms of a library, or from
//! free forms, which are arbitrary expressions. The evidence of a term is the smaller of its penalised likelihood gain and its
//! Wald statistic.

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

/// A form that the flights cannot distinguish from the first term of the formula.
#[derive(Clone, Debug, Serialize)]
pub struct Alternative {
    /// The formula, as text.
    pub formula: String,
    /// Evidence of the form.
    pub evidence: f64,
}

/// A formula that the search has tried. It has one term more than the previous formula, or it is the best free form of its
/// size.
#[derive(Clone, Debug, Serialize)]
pub struct Rung {
    /// The formula, as text.
    pub formula: String,
    /// Size of the formula: number of its variables, numbers, coefficients and operations.
    pub complexity: usize,
    /// Fraction of the residual variance beyond noise, in the searched channels, that the formula removes.
    pub removed: f64,
    /// Evidence of the last term of the formula.
    pub evidence: f64,
    /// Critical value of the evidence, from the same search on bootstrap draws under the null hypothesis.
    pub threshold: f64,
    /// Whether this formula is the chosen one.
    pub chosen: bool,
}

/// Test of the chosen formula on held-out flights, which the search did not use. Its coefficients are not estimated again.
#[derive(Clone, Debug, Serialize)]
pub struct HeldOut {
    /// Names of the flights.
    pub flights: Vec<String>,
    /// Fraction of the residual variance beyond noise, in the formula's channels, that the formula removes.
    pub removed: f64,
    /// Reduction of the residual sum of squares, in units of the noise's variance.
    pub fall: f64,
    /// Largest value of `fall` in bootstrap draws under the null hypothesis that no effect is missing; at least 0.
    pub threshold: f64,
}

/// Result of the search over free forms. This search is made if the forms of the library do not suffice.
#[derive(Clone, Debug, Serialize)]
pub struct FreeForms {
    /// Reason for the search.
    pub why: String,
    /// Number of forms evaluated, over all channels.
    pub tried: usize,
    /// The best form of each size, by channel, with fitted constants. A form is listed only if it removes more of the residual
    /// than all smaller forms.
    pub front: Vec<Rung>,
    /// Whether one of these forms is part of the chosen formula.
    pub chosen: bool,
}

/// Settings of a search for a formula.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Seed of all random draws.
    pub seed: u64,
    /// Number of bootstrap draws under the null hypothesis, which determine the critical values.
    pub nulls: usize,
    /// Ids of the effects that were excluded from the catalogue of known effects.
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
    /// Name of the model that lacks the effect.
    pub model: String,
    /// Verdict of the preceding diagnosis.
    pub verdict: Verdict,
    /// The result in plain sentences, the most important first.
    pub sentences: Vec<String>,
    /// Formulas of the search, each with one more term than the previous one.
    pub front: Vec<Rung>,
    /// The search over free forms; `None` if it was not made.
    pub free: Option<FreeForms>,
    /// Forms that these flights cannot distinguish from the first term.
    pub alike: Vec<Alternative>,
    /// Properties of the first term that are certain; `None` without a term.
    pub grades: Option<Grades>,
    /// Test on held-out flights; `None` if there is no formula to test.
    pub held_out: Option<HeldOut>,
    /// Number of forms of the library that were evaluated, including those with lagged controls.
    pub tried: usize,
    /// Reasons not to propose the formula; empty if it is proposed.
    pub refused: Vec<String>,
    /// Settings of the search.
    pub settings: Settings,
    /// Evidence of the best form in each bootstrap draw under the null hypothesis.
    pub nulls: Vec<f64>,
    /// Text of the effect file; `None` if no formula is proposed.
    pub effect: Option<String>,
    /// Further notes for the reader.
    pub notes: Vec<String>,
}
