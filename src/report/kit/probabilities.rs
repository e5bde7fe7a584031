//! Figure of the probabilities of explanations, as horizontal bars from 0 to 100 %.

use crate::Style;
use crate::kit::html::escape;
use crate::kit::numbers::percent;

/// Bars of the probabilities of explanations, of which one is right. A bar over the full width is 100 %.
#[derive(Clone, Debug)]
pub struct Probabilities {
    /// Title of the figure.
    pub title: String,
    /// A sentence under the title, which defines the probabilities; may be empty.
    pub note: String,
    /// The explanations, top to bottom.
    pub rows: Vec<ProbabilityRow>,
}

/// One explanation with its probability.
#[derive(Clone, Debug)]
pub struct ProbabilityRow {
    /// The explanation in words.
    pub label: String,
    /// Probability, 0 to 1; NaN if it could not be determined.
    pub probability: f64,
}

impl Probabilities {
    pub(crate) fn html(&self) -> String {
        let note = match self.note.is_empty() {
            true => String::new(),
            false => format!("<p class=\"note\">{}</p>\n", escape(&self.note)),
        };
        let rows: String = self.rows.iter().map(ProbabilityRow::html).collect();
        format!(
            "<figure class=\"panel bars probabilities\"><figcaption><h3>{}</h3></figcaption>\n\
             {note}<dl>\n{rows}</dl></figure>\n",
            escape(&self.title)
        )
    }
}

impl ProbabilityRow {
    fn html(&self) -> String {
        let known = self.probability.is_finite();
        let share = if known { (100.0 * self.probability).clamp(0.0, 100.0) } else { 0.0 };
        let text = match known {
            true => format!("{} %", percent(self.probability)),
            false => "cannot be determined".into(),
        };
        format!(
            "<dt>{}</dt><dd title=\"probability\"><span class=\"track\"><i class=\"bar-fill\" \
             style=\"width:{share:.2}%;background:var(--{})\"></i></span>\
             <span class=\"value\">{text}</span></dd>\n",
            escape(&self.label),
            Style::Actual.name()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_is_as_long_as_its_probability_and_stays_within_its_track() {
        let row = |probability: f64| ProbabilityRow { label: "a < b".into(), probability };
        let rows = [0.934, 0.066, f64::NAN, -0.1, 1.2].map(row).to_vec();
        let html = Probabilities { title: "t".into(), note: String::new(), rows }.html();
        let widths: Vec<&str> =
            html.split("width:").skip(1).map(|w| w.split('%').next().unwrap()).collect();
        assert_eq!(widths, ["93.40", "6.60", "0.00", "0.00", "100.00"]);
        assert!(html.contains(">93 %<") && html.contains(">7 %<"));
        assert!(html.contains("cannot be determined") && !html.contains("NaN"));
        assert!(html.contains("<dt>a &lt; b</dt>") && !html.contains("class=\"note\""));
    }
}
