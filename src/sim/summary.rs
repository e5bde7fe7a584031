//! Summary of quality measures over many flights by their median, its confidence interval and the worst value. Decimation of
//! long series.

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

/// Largest number of values in a [`Thinned`] series.
const MOST: usize = 4_000_000;

/// A series with at most 4 million values in memory. Of a longer series only every second value is kept, or every fourth, and
/// so on.
#[derive(Clone, Debug)]
pub struct Thinned {
    kept: Vec<f64>,
    every: usize,
    seen: usize,
}

impl Default for Thinned {
    fn default() -> Thinned {
        Thinned { kept: Vec::new(), every: 1, seen: 0 }
    }
}

impl Thinned {
    /// Appends a value to the series.
    pub fn push(&mut self, value: f64) {
        let number = self.seen;
        self.seen += 1;
        if number.is_multiple_of(self.every) && self.kept.len() == MOST {
            let mut place = 0_usize;
            self.kept.retain(|_| {
                place += 1;
                !place.is_multiple_of(2)
            });
            self.every *= 2;
        }
        if number.is_multiple_of(self.every) {
            self.kept.push(value);
        }
    }

    /// The values that are held, in order.
    pub fn values(&self) -> &[f64] {
        &self.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_series_is_thinned_evenly() {
        let mut series = Thinned::default();
        for k in 0..2 * MOST + 7 {
            series.push(k as f64);
        }
        let values = series.values();
        assert!(values.len() <= MOST && values.len() > MOST / 2, "{}", values.len());
        assert!(values.windows(2).all(|w| w[1] - w[0] == 4.0) && values[0] == 0.0);
    }
}
