//! Summary of quality measures (such as the overshoot) over many flights: median, its confidence interval and the worst value.
//! Also a series of numbers that thins itself out when it becomes long.

use std::collections::BTreeMap;

use serde::Serialize;

use greylag_control::quality::{MEASURES, Quality};
use greylag_num::bootstrap;
use greylag_num::statistics::quantile;

/// Seed of the bootstrap. It is fixed, so that the same flights give the same intervals.
const SEED: u64 = 96;

/// Summary of one quality measure over the flights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Median over the flights.
    pub median: f64,
    /// 95 % bootstrap interval of the median.
    pub median_ci95: [f64; 2],
    /// The worst value over the flights. The measure defines whether this is the smallest or the largest.
    pub worst: f64,
}

/// Summaries by the id of the measure.
pub type Spreads = BTreeMap<&'static str, Spread>;

/// Summary of every measure over `flights`. Only finite values count. Measures without any finite value are omitted.
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

/// A series of which at most 4 million values are kept. When it becomes longer, only every second value is kept, then every
/// fourth, and so on.
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

    /// The values that are kept, in order.
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
