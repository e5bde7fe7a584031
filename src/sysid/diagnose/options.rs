//! Options of a diagnosis.

use crate::per_flight::PerFlight;

/// Extent of a diagnosis's result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// The result with curves and decoys.
    Full,
    /// The result without curves and decoys; all other numbers are the same.
    Lean,
}

/// Options of a diagnosis.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Seed of null flights, bootstraps, decoys and the flexible model.
    pub seed: u64,
    /// Number of null flights: simulated residuals without a missing effect.
    pub nulls: usize,
    /// Number of block bootstraps of the flights.
    pub bootstraps: usize,
    /// Significance level: probability of any assertion on flights in which the model lacks no effect.
    pub level: f64,
    /// Identifiers of effects from files that are tried in addition to the catalogue.
    pub with: Vec<String>,
    /// Identifiers of effects of the catalogue that are not tried.
    pub without: Vec<String>,
    /// Extent of the result.
    pub detail: Detail,
    /// Whether the search for a formula tries free forms if no shape of the library suffices.
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
