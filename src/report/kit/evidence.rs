//! Figure of the evidence for candidate effects, as bars relative to the candidates' thresholds, in groups.
//!
//! The evidence is the test statistic of a candidate. Its threshold is what a candidate reaches by chance, without the effect.

use crate::Style;
use crate::kit::html::escape;
use crate::kit::numbers::evidence;

/// Length of the longest bar, as a ratio of evidence to threshold. A longer bar is cut off and marked.
const FULL: f64 = 6.0;

/// Bars of the ratio of evidence to threshold, with a vertical line at a ratio of 1.
#[derive(Clone, Debug)]
pub struct Evidence {
    /// Title of the figure.
    pub title: String,
    /// The groups, top to bottom.
    pub groups: Vec<EvidenceGroup>,
}

/// A group of candidates.
#[derive(Clone, Debug)]
pub struct EvidenceGroup {
    /// Title of the group: the property that its rows share.
    pub title: String,
    /// A sentence on the group; may be empty.
    pub note: String,
    /// Style of the bars.
    pub style: Style,
    /// The candidates, top to bottom.
    pub rows: Vec<EvidenceRow>,
}

/// One candidate with its evidence and its threshold.
#[derive(Clone, Debug)]
pub struct EvidenceRow {
    /// Name of the candidate.
    pub label: String,
    /// Further text on the candidate; may be empty.
    pub detail: String,
    /// Evidence; NaN if it could not be determined.
    pub value: f64,
    /// Threshold of the evidence; NaN if it is unknown.
    pub threshold: f64,
}

impl EvidenceRow {
    /// Ratio of the evidence to its threshold; NaN without a positive threshold.
    fn ratio(&self) -> f64 {
        if self.threshold > 0.0 { self.value / self.threshold } else { f64::NAN }
    }
}

impl Evidence {
    /// Length of the horizontal axis, as a ratio of evidence to threshold.
    fn full(&self) -> f64 {
        let ratios = self.groups.iter().flat_map(|g| &g.rows).map(EvidenceRow::ratio);
        let longest = ratios.filter(|r| r.is_finite()).fold(0.0, f64::max);
        longest.clamp(1.5, FULL)
    }

    pub(crate) fn html(&self) -> String {
        let full = self.full();
        let groups: String = self.groups.iter().map(|g| g.html(full)).collect();
        format!(
            "<figure class=\"panel evidence\"><figcaption><h3>{}</h3>\
             <span class=\"unit\">the upright line is what chance reaches</span></figcaption>\n\
             {groups}</figure>\n",
            escape(&self.title)
        )
    }
}

impl EvidenceGroup {
    fn html(&self, full: f64) -> String {
        let note = match self.note.is_empty() {
            true => String::new(),
            false => format!("<p class=\"note\">{}</p>", escape(&self.note)),
        };
        let rows: String = self.rows.iter().map(|r| r.html(full, self.style)).collect();
        format!(
            "<div class=\"suspects\"><h4>{}</h4>{note}<dl>\n{rows}</dl></div>\n",
            escape(&self.title)
        )
    }
}

impl EvidenceRow {
    fn html(&self, full: f64, style: Style) -> String {
        let ratio = self.ratio();
        let share = if ratio.is_finite() { (100.0 * ratio / full).clamp(0.0, 100.0) } else { 0.0 };
        let cut = if ratio > full { " cut" } else { "" };
        let detail = match self.detail.is_empty() {
            true => String::new(),
            false => format!("<small>{}</small>", escape(&self.detail)),
        };
        let text = match (self.value.is_finite(), self.threshold.is_finite()) {
            (false, _) => "cannot be determined".into(),
            (true, false) => format!("{}, chance not known", evidence(self.value)),
            (true, true) => {
                format!("{}, chance {}", evidence(self.value), evidence(self.threshold))
            }
        };
        format!(
            "<dt>{}{detail}</dt><dd><span class=\"track\"><i class=\"bar-fill{cut}\" \
             style=\"width:{share:.2}%;background:var(--{})\"></i><i class=\"tick\" \
             style=\"left:{:.2}%\"></i></span><span class=\"value\">{}</span></dd>\n",
            escape(&self.label),
            style.name(),
            100.0 / full,
            escape(&text)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(value: f64, threshold: f64) -> EvidenceRow {
        EvidenceRow { label: "lift_stall".into(), detail: String::new(), value, threshold }
    }

    #[test]
    fn bars_stay_within_their_track_whatever_the_evidence() {
        let rows = vec![row(120.0, 10.0), row(5.0, 10.0), row(-4.0, 10.0), row(f64::NAN, 10.0)];
        let rows = [rows, vec![row(50.0, 0.0), row(f64::INFINITY, f64::NAN)]].concat();
        let group =
            EvidenceGroup { title: "t".into(), note: String::new(), style: Style::Actual, rows };
        let html = Evidence { title: "e".into(), groups: vec![group] }.html();
        let widths: Vec<&str> =
            html.split("width:").skip(1).map(|w| w.split('%').next().unwrap()).collect();
        // A ratio of 12 is cut off at 6. A ratio of 0.5 fills 0.5/6 = 8.33 % of the axis. The other rows have no bar.
        assert_eq!(widths, ["100.00", "8.33", "0.00", "0.00", "0.00", "0.00"]);
        assert!(html.contains("bar-fill cut") && html.contains("left:16.67%"));
        assert!(html.contains("5.0, chance 10.0") && html.contains("cannot be determined"));
    }

    #[test]
    fn the_line_of_chance_is_in_sight_when_nothing_reaches_it() {
        let group = EvidenceGroup {
            title: "t".into(),
            note: String::new(),
            style: Style::Measured,
            rows: vec![row(1.0, 10.0)],
        };
        assert_eq!(Evidence { title: "e".into(), groups: vec![group] }.full(), 1.5);
    }
}
