//! A table of text cells.

use crate::kit::html::escape;

/// If a text in the last column has more characters than this, that column gets a larger minimum width.
const LONG: usize = 28;
/// If a table has more columns than this, the texts of all cells are wrapped, so that the table fits on a screen.
const WIDE: usize = 9;

/// A table of text with column heads.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Caption for screen readers, not displayed; may be empty.
    pub caption: String,
    /// The columns, left to right.
    pub columns: Vec<Column>,
    /// The rows, top to bottom.
    pub rows: Vec<Row>,
}

/// Head of a column.
#[derive(Clone, Debug)]
pub struct Column {
    /// Title of the column, including the unit of its numbers.
    pub title: String,
    /// Alignment of the column's text.
    pub align: Align,
}

/// Alignment of a column's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Text at the left, for words.
    Left,
    /// Text at the right, for numbers.
    Right,
}

/// One row of a table.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// Text of the row's cells, one per column.
    pub cells: Vec<String>,
    /// Start and end of the time that the row describes, s. If set, the first cell is a button that zooms the plots over time to
    /// this interval.
    pub span_s: Option<[f64; 2]>,
    /// Anchor for links to this row; `None` for no anchor.
    pub anchor: Option<String>,
    /// Anchor to which the first cell links; `None` for no link.
    pub link: Option<String>,
}

impl Table {
    /// A table without rows; `columns` are titles and alignments.
    pub fn new(caption: &str, columns: &[(&str, Align)]) -> Self {
        let column = |&(title, align): &(&str, Align)| Column { title: title.into(), align };
        Table {
            caption: caption.into(),
            columns: columns.iter().map(column).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row of text.
    pub fn push<I: IntoIterator<Item = String>>(&mut self, cells: I) {
        self.rows.push(Row { cells: cells.into_iter().collect(), ..Row::default() });
    }

    pub(crate) fn html(&self) -> String {
        let class = |i: usize| match self.columns.get(i).map(|c| c.align) {
            Some(Align::Right) => " class=\"number\"",
            _ => "",
        };
        let head: String = self
            .columns
            .iter()
            .enumerate()
            .map(|(i, c)| format!("<th scope=\"col\"{}>{}</th>", class(i), escape(&c.title)))
            .collect();
        let last = |row: &Row| row.cells.last().map_or(0, |text| text.chars().count());
        let long = self.rows.iter().map(last).max().unwrap_or(0) > LONG;
        let class_of_all = match (long, self.columns.len() > WIDE) {
            (true, true) => " class=\"long wide\"",
            (true, false) => " class=\"long\"",
            (false, true) => " class=\"wide\"",
            (false, false) => "",
        };
        let mut html = format!(
            "<div class=\"table\" tabindex=\"0\"><table{class_of_all}><caption>{}</caption>\
             <thead><tr>{head}</tr></thead>\n<tbody>\n",
            escape(&self.caption)
        );
        for row in &self.rows {
            let cell = |(i, text): (usize, &String)| {
                format!("<td{}>{}</td>", class(i), row.cell_html(i, text))
            };
            let cells: String = row.cells.iter().enumerate().map(cell).collect();
            let anchor = row.anchor.as_ref();
            let id = anchor.map_or(String::new(), |a| format!(" id=\"{}\"", escape(a)));
            html.push_str(&format!("<tr{id}>{cells}</tr>\n"));
        }
        html.push_str("</tbody></table></div>\n");
        html
    }
}

impl Row {
    fn cell_html(&self, index: usize, text: &str) -> String {
        if let (Some(to), 0) = (&self.link, index) {
            return format!("<a href=\"#{}\">{}</a>", escape(to), escape(text));
        }
        match self.span_s {
            Some([from, to]) if index == 0 && from.is_finite() && to.is_finite() => format!(
                "<button type=\"button\" class=\"zoom\" data-from=\"{from}\" data-to=\"{to}\" \
                 title=\"Zoom to this time\">{}</button>",
                escape(text)
            ),
            _ => escape(text),
        }
    }
}
