//! Lines of a quantity over another, the height by decades or evenly.

use serde::Serialize;

use crate::Series;
use crate::kit::html::compact;
use crate::kit::xy::plotted;

/// Lines over one horizontal quantity.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Curves {
    /// Title of the figure.
    #[serde(skip)]
    pub title: String,
    /// Name of the horizontal axis, with its unit.
    pub x_label: String,
    /// Name of the vertical axis, with its unit.
    pub y_label: String,
    /// Abscissae, in ascending order.
    #[serde(serialize_with = "compact")]
    pub x: Vec<f64>,
    /// The lines, with one value per abscissa. A value outside the domain of the scale leaves a gap.
    pub series: Vec<Series>,
    /// Shaded ranges around lines, such as the least and the most of several seeds.
    pub ranges: Vec<Range>,
    /// Heights evenly instead of by decades.
    pub linear: bool,
}

/// A shaded range in the colour of a line.
#[derive(Clone, Debug, Serialize)]
pub struct Range {
    /// Index of the line among the series.
    pub of: usize,
    /// Lower edge, as many values as horizontal ones.
    #[serde(serialize_with = "compact")]
    pub low: Vec<f64>,
    /// Upper edge, as many values as horizontal ones.
    #[serde(serialize_with = "compact")]
    pub high: Vec<f64>,
}

impl Curves {
    pub(crate) fn html(&self, index: usize) -> String {
        plotted(&self.title, index)
    }
}
