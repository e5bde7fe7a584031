//! A page of a report: sections with figures, which are rendered into one HTML file.

use serde_json::Value;

use crate::kit::html::{escape, script_json};
use crate::{Figure, Verdict};

const UPLOT_SCRIPT: &str = include_str!("assets/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("assets/uPlot.min.css");
const UPLOT_LICENCE: &str = include_str!("assets/uPlot.LICENSE");
const STYLE: &str = include_str!("assets/page.css");
/// Scripts that set the line breaks and draw the figures. Each uses functions of the scripts before it, so all run in one scope.
const SCRIPTS: [&str; 5] = [
    include_str!("assets/words.js"),
    include_str!("assets/draw.js"),
    include_str!("assets/link.js"),
    include_str!("assets/bins.js"),
    include_str!("assets/page.js"),
];
/// Script that sets the light or dark theme before the page is drawn. Otherwise a dark page would first appear white.
const THEME_SCRIPT: &str = include_str!("assets/theme.js");

/// A page: a title and sections.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Title of the page and of the browser tab.
    pub title: String,
    /// Subtitle of the page.
    pub subtitle: String,
    /// The sections, in order.
    pub sections: Vec<Section>,
}

/// A section: figures under a common heading.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The heading; empty for no heading.
    pub title: String,
    /// One or two sentences under the heading, which state what the figures show and how it is defined.
    pub note: String,
    /// The figures, in order.
    pub figures: Vec<Figure>,
    /// Whether the section is initially open. A section with plots must be open, because a plot takes its size when it is drawn.
    pub folding: Folding,
}

/// Initial state of a section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Folding {
    /// Open when the page loads.
    #[default]
    Open,
    /// Closed when the page loads; a click on the heading opens it.
    Folded,
}

impl Page {
    /// The page as a self-contained HTML file in UTF-8.
    pub fn render(&self) -> String {
        let mut data = Vec::new();
        let mut body = String::new();
        for (i, section) in self.sections.iter().enumerate() {
            body.push_str(&section.html(i, &mut data));
        }
        let title = escape(&self.title);
        let subtitle = escape(&self.subtitle);
        let contents = self.contents();
        let script = SCRIPTS.concat();
        let data = data.join(",\n");
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\" data-theme=\"light\">\n<head>\n\
             <meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
             style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <link rel=\"icon\" href=\"data:,\">\n\
             <title>{title}</title>\n\
             <style>\n{UPLOT_STYLE}\n{STYLE}</style>\n<script>\n{THEME_SCRIPT}</script>\n\
             </head>\n<body>\n\
             <header class=\"bar\"><nav aria-label=\"Sections\">{contents}</nav>\
             <div class=\"tools\"><output id=\"window\"></output>\
             <button type=\"button\" id=\"reset\" disabled>Reset zoom</button>\
             <button type=\"button\" id=\"theme\">Light or dark</button></div></header>\n\
             <main>\n<h1>{title}</h1>\n<p class=\"subtitle\">{subtitle}</p>\n{body}\
             <footer><p>Drag across a plot to zoom, double-click or press 0 to reset, arrow keys \
             to move the cursor, + and − to zoom, Shift with an arrow to shift. On a touch \
             screen: slide to read, pinch to zoom, double tap to reset.</p>\
             <noscript><p>The plots need JavaScript, which is part of this file.</p></noscript>\
             </footer>\n</main>\n\
             <script type=\"application/json\" id=\"figures\">[\n{data}\n]</script>\n\
             <script>\n/*\n{UPLOT_LICENCE}*/\n{UPLOT_SCRIPT}</script>\n\
             <script>\n(() => {{\n\"use strict\";\n{script}}})();\n</script>\n</body>\n</html>\n"
        )
    }

    fn contents(&self) -> String {
        let titled = self.sections.iter().enumerate().filter(|(_, s)| !s.title.is_empty());
        titled.map(|(i, s)| format!("<a href=\"#s{i}\">{}</a>", escape(&s.title))).collect()
    }
}

impl Section {
    /// A section with a heading, a note and figures; heading and note may be empty.
    pub fn new(title: &str, note: &str, figures: Vec<Figure>) -> Self {
        Section { title: title.into(), note: note.into(), figures, folding: Folding::Open }
    }

    /// The section, initially closed with only its heading visible.
    pub fn folded(self) -> Self {
        Section { folding: Folding::Folded, ..self }
    }

    /// A section without a heading that contains one verdict.
    pub fn verdict(verdict: Verdict) -> Self {
        Section::new("", "", vec![Figure::Verdict(verdict)])
    }

    /// The section as HTML. Appends the data of its plots to `data`, with one JSON value per plot.
    fn html(&self, index: usize, data: &mut Vec<String>) -> String {
        let mut html = format!("<section id=\"s{index}\">\n");
        let heading = match (self.title.is_empty(), self.folding) {
            (true, _) => String::new(),
            (false, Folding::Open) => format!("<h2>{}</h2>\n", escape(&self.title)),
            (false, Folding::Folded) => {
                format!("<details><summary><h2>{}</h2></summary>\n", escape(&self.title))
            }
        };
        html.push_str(&heading);
        if !self.note.is_empty() {
            html.push_str(&format!("<p class=\"note\">{}</p>\n", escape(&self.note)));
        }
        html.push_str("<div class=\"figures\">\n");
        for figure in &self.figures {
            html.push_str(&figure.html(data));
        }
        let end = if heading.starts_with("<details>") { "</details>\n" } else { "" };
        html.push_str(&format!("</div>\n{end}</section>\n"));
        html
    }
}

impl Figure {
    pub(crate) fn html(&self, data: &mut Vec<String>) -> String {
        let index = data.len();
        match self {
            Figure::Verdict(verdict) => verdict.html(),
            Figure::Answer(answer) => answer.html(),
            Figure::Drawing(drawing) => drawing.html(),
            Figure::Table(table) => table.html(),
            Figure::Findings(findings) => findings.html(),
            Figure::Bars(bars) => bars.html(),
            Figure::Evidence(evidence) => evidence.html(),
            Figure::Probabilities(probabilities) => probabilities.html(),
            Figure::Whiskers(whiskers) => whiskers.html(),
            Figure::Grid(grid) => grid.html(),
            Figure::Choice(choice) => choice.html(data),
            Figure::Curves(figure) => {
                data.push(plot_json("curves", script_json(figure)));
                figure.html(index)
            }
            Figure::Intervals(figure) => {
                data.push(plot_json("intervals", script_json(figure)));
                figure.html(index)
            }
            Figure::HeatMap(figure) => {
                data.push(plot_json("heat", script_json(figure)));
                figure.html(index)
            }
            Figure::Time(figure) => {
                data.push(plot_json("time", script_json(figure)));
                figure.html(index)
            }
            Figure::Xy(figure) => {
                data.push(plot_json("xy", script_json(figure)));
                figure.html(index)
            }
            Figure::Histogram(figure) => {
                data.push(plot_json("histogram", script_json(figure)));
                figure.html(index)
            }
        }
    }
}

fn plot_json(kind: &str, json: String) -> String {
    format!("{{\"kind\":{},\"data\":{json}}}", Value::from(kind))
}
