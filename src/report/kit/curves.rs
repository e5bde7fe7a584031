//! A figure with curves of one quantity over another. The vertical axis is logarithmic or linear.

use serde::Serialize;

use crate::Series;
use crate::kit::html::compact;
use crate::kit::xy::plotted;

/// A figure of curves over a common horizontal axis.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Curves {
    /// Title of the figure.
    #[serde(skip)]
    pub title: String,
    /// Name of the horizontal axis, with its unit.
    pub x_label: String,
    /// Name of the vertical axis, with its unit.
    pub y_label: String,
    /// Values on the horizontal axis, ascending.
    #[serde(serialize_with = "compact")]
    pub x: Vec<f64>,
    /// The curves, each with one value per element of `x`. A value that the axis cannot show, such as 0 on a logarithmic one,
    /// leaves a gap.
    pub series: Vec<Series>,
    /// Shaded ranges around curves, such as from the minimum to the maximum over several seeds.
    pub ranges: Vec<Range>,
    /// Whether the vertical axis is linear instead of logarithmic.
    pub linear: bool,
}

/// A shaded range in the colour of its curve.
#[derive(Clone, Debug, Serialize)]
pub struct Range {
    /// Index of the curve in `Curves::series`.
    pub of: usize,
    /// Lower edge, one value for each of [`Curves::x`].
    #[serde(serialize_with = "compact")]
    pub low: Vec<f64>,
    /// Upper edge, one value for each of [`Curves::x`].
    #[serde(serialize_with = "compact")]
    pub high: Vec<f64>,
}

impl Curves {
    pub(crate) fn html(&self, index: usize) -> String {
        plotted(&self.title, index)
    }
}
