//! A figure with a table of numbers. The background of each cell is shaded, more strongly for a greater weight of the cell.

use crate::kit::html::escape;

/// Table of numbers with shaded cells.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Title of the figure.
    pub title: String,
    /// Quantity and unit of the numbers.
    pub unit: String,
    /// Heading of the column of row labels.
    pub corner: String,
    /// Column heads: a symbol and its meaning.
    pub columns: Vec<(String, String)>,
    /// The rows, top to bottom.
    pub rows: Vec<GridRow>,
}

/// A row of the table.
#[derive(Clone, Debug)]
pub struct GridRow {
    /// Name of the row.
    pub label: String,
    /// Cells of the row, one per column.
    pub cells: Vec<GridCell>,
}

/// A cell of the table.
#[derive(Clone, Debug)]
pub struct GridCell {
    /// Text of the cell; may be empty.
    pub text: String,
    /// Strength of the shading: 0 for none, 1 for the strongest. Other values are limited to this range.
    pub weight: f64,
}

impl Grid {
    pub(crate) fn html(&self) -> String {
        let head: String = self
            .columns
            .iter()
            .map(|(sign, name)| {
                let (sign, name) = (escape(sign), escape(name));
                format!(
                    "<th scope=\"col\" class=\"number\"><abbr title=\"{name}\">{sign}</abbr></th>"
                )
            })
            .collect();
        let rows: String = self.rows.iter().map(GridRow::html).collect();
        format!(
            "<figure class=\"panel grid\"><figcaption><h3>{title}</h3><span class=\"unit\">{}</span>\
             </figcaption><div class=\"table\" tabindex=\"0\"><table><caption>{title}</caption>\
             <thead><tr><th scope=\"col\">{}</th>{head}</tr></thead>\n<tbody>\n{rows}</tbody></table>\
             </div></figure>\n",
            escape(&self.unit),
            escape(&self.corner),
            title = escape(&self.title)
        )
    }
}

impl GridRow {
    fn html(&self) -> String {
        let cell = |c: &GridCell| {
            let weight = if c.weight.is_finite() { c.weight.clamp(0.0, 1.0) } else { 0.0 };
            format!(
                "<td class=\"number\" style=\"--weight:{:.0}%\">{}</td>",
                100.0 * weight,
                escape(&c.text)
            )
        };
        let cells: String = self.cells.iter().map(cell).collect();
        format!("<tr><th scope=\"row\">{}</th>{cells}</tr>\n", escape(&self.label))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_percentages_whatever_they_were() {
        let cells = [0.25, 7.0, -1.0, f64::NAN];
        let cells = cells.map(|weight| GridCell { text: "<".into(), weight }).to_vec();
        let html = GridRow { label: "L".into(), cells }.html();
        let weights: Vec<&str> =
            html.split("--weight:").skip(1).map(|w| w.split('%').next().unwrap()).collect();
        assert_eq!(weights, ["25", "100", "0", "0"]);
        assert!(html.contains("&lt;"));
    }
}
