//! What a diagnosis is asked for.

use crate::per_flight::PerFlight;

/// How much a diagnosis works out besides its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Everything.
    Full,
    /// The same numbers without curves and decoys, which only show and check.
    Lean,
}

/// What a diagnosis is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Seed of nulls, bootstraps, decoys and the flexible model.
    pub seed: u64,
    /// Nulls drawn.
    pub nulls: usize,
    /// Block bootstraps.
    pub bootstraps: usize,
    /// Chance that is allowed of any assertion in a flight that lacks nothing.
    pub level: f64,
    /// Ids of effects of files, tried beside the catalogue.
    pub with: Vec<String>,
    /// Ids left out of the catalogue.
    pub without: Vec<String>,
    /// What is worked out besides.
    pub detail: Detail,
    /// Whether the search for a formula tries free forms where the shapes of its library are not all.
    pub free_forms: bool,
    /// What each flight has of its own beside its sensors' errors.
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
