//! A figure that shows a signed quantity over two other quantities by coloured cells.

use serde::Serialize;

use crate::kit::html::{compact, escape};

/// A map of cells, coloured from blue (negative) to orange (positive).
#[derive(Clone, Debug, Serialize)]
pub struct HeatMap {
    /// Title of the figure.
    #[serde(skip)]
    pub title: String,
    /// Name of the horizontal axis, with its unit.
    pub x_label: String,
    /// Name of the vertical axis, with its unit.
    pub y_label: String,
    /// Unit of the cell values.
    pub unit: String,
    /// Magnitude at the ends of the colour scale, in the unit of the cells; positive.
    pub limit: f64,
    /// Edges of the columns, ascending.
    #[serde(serialize_with = "compact")]
    pub x_edges: Vec<f64>,
    /// Edges of the rows, ascending.
    #[serde(serialize_with = "compact")]
    pub y_edges: Vec<f64>,
    /// The cells with data; other cells stay blank.
    pub cells: Vec<HeatCell>,
}

/// One cell of the map.
#[derive(Clone, Debug, Serialize)]
pub struct HeatCell {
    /// Column of the cell, from 0.
    pub x: usize,
    /// Row of the cell, from 0.
    pub y: usize,
    /// Value of the cell, in the figure's unit.
    #[serde(serialize_with = "compact_one")]
    pub value: f64,
    /// Number of independent samples in the cell.
    pub samples: usize,
    /// Whether the samples are sufficient; otherwise the cell is hatched.
    pub supported: bool,
}

fn compact_one<S: serde::Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    // single precision is finer than the resolution of the colours
    match value.is_finite() {
        true => serializer.serialize_f32(*value as f32),
        false => serializer.serialize_none(),
    }
}

impl HeatMap {
    pub(crate) fn html(&self, index: usize) -> String {
        let title = escape(&self.title);
        let limit = three_digits(self.limit);
        let unit = escape(&self.unit);
        format!(
            "<figure class=\"panel heat\"><figcaption><h3>{title}</h3>\
             <output class=\"readout\"></output></figcaption>\
             <div class=\"plot\" data-figure=\"{index}\" tabindex=\"0\" role=\"img\" \
             aria-label=\"{title}, map\"></div>\
             <div class=\"scale\"><span>−{limit} {unit}</span><i class=\"ramp\"></i>\
             <span>+{limit} {unit}</span>\
             <span class=\"entry\"><i class=\"swatch hatched\"></i>too few samples</span>\
             <span class=\"entry\"><i class=\"swatch blank\"></i>not flown</span></div></figure>\n"
        )
    }
}

fn three_digits(value: f64) -> String {
    let digits = if value > 0.0 { (2 - value.log10().floor() as i32).clamp(0, 6) } else { 0 };
    format!("{value:.*}", digits as usize)
}
