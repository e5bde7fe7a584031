//! Options of a diagnosis.

use crate::per_flight::PerFlight;

/// Extent of a diagnosis's result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// The result with curves and decoys.
    Full,
    /// The same numbers without curves and decoys, which only illustrate and check.
    Lean,
}

/// Options of a diagnosis.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Seed of null flights, bootstraps, decoys and the flexible model.
    pub seed: u64,
    /// Number of null flights.
    pub nulls: usize,
    /// Number of block bootstraps.
    pub bootstraps: usize,
    /// Significance level: probability of any assertion on flights that lack nothing.
    pub level: f64,
    /// Ids of effects from files, tried in addition to the catalogue.
    pub with: Vec<String>,
    /// Ids excluded from the catalogue.
    pub without: Vec<String>,
    /// Extent of the result.
    pub detail: Detail,
    /// Whether the search for a formula tries free forms if the shapes of its library do not suffice.
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
