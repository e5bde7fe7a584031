//! Mean of a quantity over bins of other quantities, with confidence intervals: one small plot for each of the other
//! quantities.

use serde::Serialize;

use crate::Style;
use crate::kit::bars::keys_html;
use crate::kit::html::{compact, escape};

/// Small plots with a common vertical scale. Each shows binned means over one quantity.
#[derive(Clone, Debug, Serialize)]
pub struct Intervals {
    /// Name of the vertical axis, with its unit.
    pub y_label: String,
    /// Unit of the means.
    pub unit: String,
    /// Names and styles of the lines in every panel, in order.
    pub keys: Vec<(String, Style)>,
    /// One panel for each quantity on a horizontal axis.
    pub panels: Vec<IntervalPanel>,
}

/// Panel with one quantity on its horizontal axis.
#[derive(Clone, Debug, Serialize)]
pub struct IntervalPanel {
    /// Name of the quantity on the horizontal axis.
    pub title: String,
    /// Unit of the quantity on the horizontal axis; empty if it is dimensionless.
    pub unit: String,
    /// Names at the positions 0, 1, 2 … if the bins are names instead of intervals; empty otherwise.
    pub names: Vec<String>,
    /// The bins of each line, one element per key.
    pub lines: Vec<IntervalBins>,
}

/// The bins of one line; all lists have the same length.
#[derive(Clone, Debug, Default, Serialize)]
pub struct IntervalBins {
    /// Lower edges of the bins, in the unit of the panel; NaN if a bin is open below.
    #[serde(serialize_with = "compact")]
    pub from: Vec<f64>,
    /// Upper edges of the bins, in the unit of the panel; NaN if a bin is open above.
    #[serde(serialize_with = "compact")]
    pub to: Vec<f64>,
    /// Horizontal position of the mean, in the unit of the panel.
    #[serde(serialize_with = "compact")]
    pub center: Vec<f64>,
    /// Mean of each bin.
    #[serde(serialize_with = "compact")]
    pub mean: Vec<f64>,
    /// Lower ends of the 95 % intervals.
    #[serde(serialize_with = "compact")]
    pub low: Vec<f64>,
    /// Upper ends of the 95 % intervals.
    #[serde(serialize_with = "compact")]
    pub high: Vec<f64>,
    /// Number of independent samples in each bin.
    pub samples: Vec<usize>,
    /// Whether each bin has enough samples. A bin with too few samples is drawn grey.
    pub supported: Vec<bool>,
}

impl Intervals {
    pub(crate) fn html(&self, index: usize) -> String {
        let mut html = format!(
            "<div class=\"intervals\"><div class=\"keys\"><span class=\"unit\">{}</span>{}\
             <span class=\"legend\"><span class=\"entry\"><i class=\"swatch thin\"></i>\
             too few samples</span></span></div>\n<div class=\"multiples\">\n",
            escape(&self.y_label),
            keys_html(&self.keys)
        );
        for (p, panel) in self.panels.iter().enumerate() {
            let (title, unit) = (escape(&panel.title), escape(&panel.unit));
            html.push_str(&format!(
                "<figure class=\"panel\"><figcaption><h3>{title}</h3>\
                 <span class=\"unit\">{unit}</span><output class=\"readout\"></output></figcaption>\
                 <div class=\"plot\" data-figure=\"{index}\" data-panel=\"{p}\" tabindex=\"0\" \
                 role=\"img\" aria-label=\"{} over {title}\"></div></figure>\n",
                escape(&self.y_label)
            ));
        }
        html + "</div></div>\n"
    }
}
