//! Options of a diagnosis.

use crate::per_flight::PerFlight;

/// Selection of the parts that the result of a diagnosis contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// The result with curves and placebo regressors (decoys).
    Full,
    /// The result without curves and placebo regressors. All other numbers are the same.
    Lean,
}

/// Options of a diagnosis.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Seed of all random draws: bootstraps, placebo regressors, and features of the flexible model.
    pub seed: u64,
    /// Number of bootstrap draws under the null hypothesis that no effect is missing. They determine the critical
    /// values.
    pub nulls: usize,
    /// Number of block bootstraps that test how stably an effect is selected.
    pub bootstraps: usize,
    /// Significance level: probability that any effect is asserted if no effect is missing.
    pub level: f64,
    /// Identifiers of effects from effect files that are candidates in addition to the catalogue.
    pub with: Vec<String>,
    /// Identifiers of effects of the catalogue that are not candidates.
    pub without: Vec<String>,
    /// Selection of the parts that the result contains.
    pub detail: Detail,
    /// Whether the search for a formula enumerates expressions (free forms) if no shape of its library suffices.
    pub free_forms: bool,
    /// Constants estimated for each flight in addition to its sensor errors.
    pub per_flight: PerFlight,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            seed: 1,
            nulls: 100,
            bootstraps: 100,
            level: 0.01,
            with: Vec::new(),
            without: Vec::new(),
            detail: Detail::Full,
            free_forms: true,
            per_flight: PerFlight::default(),
        }
    }
}
