//! The measures of many flights: median with its interval, and the worst.

use std::collections::BTreeMap;

use serde::Serialize;

use greylag_control::quality::{MEASURES, Quality};
use greylag_num::bootstrap;
use greylag_num::statistics::quantile;

/// Seed of the intervals' resamples: the same flights have the same intervals.
const SEED: u64 = 96;

/// A measure over some flights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// Its 95 % interval over the flights (bootstrap).
    pub median_ci95: [f64; 2],
    /// The worst.
    pub worst: f64,
}

/// Measures by their id.
pub type Spreads = BTreeMap<&'static str, Spread>;

/// Every measure over these flights; those of which no flight knows anything are left out.
pub fn spreads(flights: &[&Quality]) -> Spreads {
    let of = |measure: &greylag_control::quality::Measure| {
        let values = flights.iter().map(|q| (measure.get)(q));
        let values: Vec<f64> = values.filter(|x| x.is_finite()).collect();
        let median = |values: &[f64]| quantile(values, 0.5);
        (!values.is_empty()).then(|| Spread {
            median: median(&values),
            median_ci95: bootstrap::interval(&values, SEED, median),
            worst: measure.worst(&values),
        })
    };
    MEASURES.iter().filter_map(|m| Some((m.id, of(m)?))).collect()
}
