//! Summary of quality measures over many flights: median with interval, and the worst.

use std::collections::BTreeMap;

use serde::Serialize;

use greylag_control::quality::{MEASURES, Quality};
use greylag_num::bootstrap;
use greylag_num::statistics::quantile;

/// Seed of the bootstrap: the same flights give the same intervals.
const SEED: u64 = 96;

/// Summary of one measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Median over the flights.
    pub median: f64,
    /// 95 % bootstrap interval of the median over the flights.
    pub median_ci95: [f64; 2],
    /// The worst value over the flights: smallest or largest, as the measure defines.
    pub worst: f64,
}

/// Summaries by the id of the measure.
pub type Spreads = BTreeMap<&'static str, Spread>;

/// Summary of every measure over `flights`, from its finite values. Measures without a finite value are omitted.
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
