//! Options of a diagnosis, the search for effects (physical contributions to forces and moments) that a model lacks. A candidate
//! is an effect that the model may lack. An effect is asserted if the diagnosis states that the model lacks it.

use crate::per_flight::PerFlight;

/// Selection of the parts that the result of a diagnosis contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// The result has the candidates' curves and the placebo regressors (decoys, which check for false detections).
    Full,
    /// The result has no curves and placebo regressors. All other numbers are the same.
    Lean,
}

/// Options of a diagnosis.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Seed of all random draws: bootstraps, placebo regressors, and features of the flexible model that estimates what is left
    /// unexplained.
    pub seed: u64,
    /// Number of bootstrap draws under the null hypothesis that no effect is missing. They determine the critical values of the
    /// evidence.
    pub nulls: usize,
    /// Number of block bootstraps that test how stably an effect is selected.
    pub bootstraps: usize,
    /// Significance level: probability that any effect is asserted if no effect is missing.
    pub level: f64,
    /// Identifiers of effects from effect files that are candidates in addition to the catalogue (the effects that the program
    /// knows).
    pub with: Vec<String>,
    /// Identifiers of effects of the catalogue that are not candidates.
    pub without: Vec<String>,
    /// Selection of the parts that the result contains.
    pub detail: Detail,
    /// Whether the search for a formula also enumerates expressions ("free forms") if no formula of its library suffices.
    pub free_forms: bool,
    /// Constants that are estimated for each flight in addition to its sensor errors.
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
