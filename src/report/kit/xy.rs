//! Plot of one quantity over another, as points or as a path.

use serde::Serialize;

use crate::Style;
use crate::kit::html::{compact, escape};

/// A pair of axes with points or paths.
#[derive(Clone, Debug, Serialize)]
pub struct XyFigure {
    /// Title of the figure.
    #[serde(skip)]
    pub title: String,
    /// Name of the horizontal axis, with its unit.
    pub x_label: String,
    /// Name of the vertical axis, with its unit.
    pub y_label: String,
    /// Shaded bands behind the series.
    pub bands: Vec<XyBand>,
    /// Points and paths, in drawing order.
    pub series: Vec<XySeries>,
}

/// A shaded band over a range of the horizontal axis.
#[derive(Clone, Debug, Serialize)]
pub struct XyBand {
    /// Name of the band in the legend.
    pub label: String,
    /// Abscissae, in ascending order.
    #[serde(serialize_with = "compact")]
    pub x: Vec<f64>,
    /// Lower edge, one value per abscissa.
    #[serde(serialize_with = "compact")]
    pub low: Vec<f64>,
    /// Upper edge, one value per abscissa.
    #[serde(serialize_with = "compact")]
    pub high: Vec<f64>,
}

/// A series of points.
#[derive(Clone, Debug, Serialize)]
pub struct XySeries {
    /// Name of the series in the legend.
    pub label: String,
    /// Meaning of the series, which sets its colour.
    pub style: Style,
    /// Type of the marks.
    pub mark: XyMark,
    /// Horizontal values; a pair with a value that is not finite interrupts a path.
    #[serde(serialize_with = "compact")]
    pub x: Vec<f64>,
    /// Vertical values, one per horizontal value.
    #[serde(serialize_with = "compact")]
    pub y: Vec<f64>,
}

/// Type of the marks of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum XyMark {
    /// A thin line through the points.
    Path,
    /// A wide line through the points.
    Line,
    /// Small filled points, for large numbers of points.
    Dots,
    /// Open circles at the points.
    Circles,
    /// Crosses at the points.
    Crosses,
}

impl XyFigure {
    pub(crate) fn html(&self, index: usize) -> String {
        plotted(&self.title, index)
    }
}

/// HTML frame of a figure that the page's script draws.
pub(super) fn plotted(title: &str, index: usize) -> String {
    let title = escape(title);
    format!(
        "<figure class=\"panel xy\"><figcaption><h3>{title}</h3></figcaption>\
         <div class=\"plot\" data-figure=\"{index}\" tabindex=\"0\" role=\"img\" \
         aria-label=\"{title}\"></div></figure>\n"
    )
}
