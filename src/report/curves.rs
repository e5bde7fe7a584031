//! Lines of a positive quantity over another, the height by decades.

use serde::Serialize;

use super::Series;
use super::html::{compact, escape};

/// Lines over one horizontal quantity, on a vertical scale of decades.
#[derive(Clone, Debug, Serialize)]
pub struct Curves {
    /// What is shown.
    #[serde(skip)]
    pub title: String,
    /// Name of the horizontal axis, with its unit.
    pub x_label: String,
    /// Name of the vertical axis, with its unit.
    pub y_label: String,
    /// Horizontal values, ascending.
    #[serde(serialize_with = "compact")]
    pub x: Vec<f64>,
    /// The lines; one value for each horizontal one, what is not positive is a gap.
    pub series: Vec<Series>,
}

impl Curves {
    pub(super) fn html(&self, index: usize) -> String {
        let title = escape(&self.title);
        format!(
            "<figure class=\"panel xy\"><figcaption><h3>{title}</h3></figcaption>\
             <div class=\"plot\" data-figure=\"{index}\" tabindex=\"0\" role=\"img\" \
             aria-label=\"{title}\"></div></figure>\n"
        )
    }
}
