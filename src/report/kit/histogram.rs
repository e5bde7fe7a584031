//! Histogram with logarithmic axes.

use serde::Serialize;

use crate::Rule;
use crate::kit::html::{compact, escape};

/// Number of bins per decade.
const BINS_PER_DECADE: f64 = 20.0;

/// Counts in bins. Both axes are logarithmic, so that rare large values are visible.
#[derive(Clone, Debug, Serialize)]
pub struct Histogram {
    /// Title of the figure.
    #[serde(skip)]
    pub title: String,
    /// Name of the horizontal axis, with its unit.
    pub x_label: String,
    /// Name of the counted items, in the plural form.
    pub counted: String,
    /// Edges of the bins, ascending; one more than the counts.
    #[serde(serialize_with = "compact")]
    edges: Vec<f64>,
    /// Number of values in each bin.
    counts: Vec<u64>,
    /// Values marked on the horizontal axis, in its unit.
    rules: Vec<Rule>,
}

impl Histogram {
    /// Counts the positive finite `values` (in the unit of `x_label`) in bins of equal width on a logarithmic axis. The bins also
    /// cover the marked values `rules`.
    pub fn log(
        title: &str,
        x_label: &str,
        counted: &str,
        values: &[f64],
        rules: Vec<Rule>,
    ) -> Self {
        let usable = |v: &f64| v.is_finite() && *v > 0.0;
        let bin = |v: f64| (v.log10() * BINS_PER_DECADE).floor() as i64;
        let bins = || values.iter().copied().filter(usable).map(bin);
        let seen = || bins().chain(rules.iter().map(|r| r.value).filter(usable).map(bin));
        let (first, last) = (seen().min().unwrap_or(0), seen().max().unwrap_or(0));
        let edge = |i: i64| 10f64.powf(i as f64 / BINS_PER_DECADE);
        let mut counts = vec![0; (last - first + 1) as usize];
        for i in bins() {
            counts[(i - first) as usize] += 1;
        }
        Histogram {
            title: title.into(),
            x_label: x_label.into(),
            counted: counted.into(),
            edges: (first..=last + 1).map(edge).collect(),
            counts,
            rules,
        }
    }

    pub(crate) fn html(&self, index: usize) -> String {
        let title = escape(&self.title);
        format!(
            "<figure class=\"panel histogram\"><figcaption><h3>{title}</h3>\
             <output class=\"readout\"></output></figcaption>\
             <div class=\"plot\" data-figure=\"{index}\" tabindex=\"0\" role=\"img\" \
             aria-label=\"{title}, histogram\"></div></figure>\n"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_positive_value_is_counted_once_within_its_bin() {
        let values = [0.1, 0.11, 1.0, 10.0, 0.0, -1.0, f64::NAN, f64::INFINITY];
        let budget = Rule { value: 100.0, label: "budget".into() };
        let h = Histogram::log("t", "ms", "cycles", &values, vec![budget]);
        // Four of the eight values are positive and finite.
        assert_eq!(h.counts.iter().sum::<u64>(), 4);
        assert_eq!(h.edges.len(), h.counts.len() + 1);
        assert!(h.edges[0] <= 0.1 && h.edges[h.edges.len() - 1] > 100.0);
        for v in [0.11, 1.0] {
            let bin = h.edges.iter().rposition(|&e| e <= v * (1.0 + 1e-12)).unwrap();
            assert!(h.counts[bin] >= 1, "{v} is not in the bin from {}", h.edges[bin]);
        }
    }

    #[test]
    fn no_value_is_an_empty_histogram() {
        assert_eq!(Histogram::log("t", "ms", "cycles", &[], Vec::new()).counts, [0]);
    }
}
