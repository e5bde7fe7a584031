//! A figure of SVG lines and areas, drawn to scale.

use crate::kit::html::escape;

/// A drawing to scale. Its SVG elements have the CSS classes `body`, `wing` and `surface`.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// Title of the drawing.
    pub title: String,
    /// Text alternative for users who cannot see the drawing.
    pub said: String,
    /// Width and height, in the unit of the drawing's coordinates.
    pub size: [f64; 2],
    /// SVG elements of the drawing. They must not contain unescaped text of a user.
    pub svg: String,
}

impl Drawing {
    pub(crate) fn html(&self) -> String {
        let [width, height] = self.size;
        let edge = 0.01 * width;
        format!(
            "<figure class=\"panel drawing\"><figcaption><h3>{}</h3></figcaption><svg role=\"img\" aria-label=\"{}\" \
             viewBox=\"{:.4} {:.4} {:.4} {:.4}\">{}</svg></figure>\n",
            escape(&self.title),
            escape(&self.said),
            -edge,
            -edge,
            width + 2.0 * edge,
            height + 2.0 * edge,
            self.svg
        )
    }
}
