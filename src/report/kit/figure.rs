//! The kinds of figure a section may hold.

use serde::Serialize;

use crate::kit::html::escape;
use crate::{
    AnswerBox, Bars, Choice, Curves, Drawing, Evidence, Findings, Grid, HeatMap, Histogram,
    Intervals, Table, TimeFigure, Whiskers, XyFigure,
};

/// One figure of a section.
#[derive(Clone, Debug)]
pub enum Figure {
    /// Verdict in one sentence.
    Verdict(Verdict),
    /// The answer, before anything else.
    Answer(Box<AnswerBox>),
    /// Lines and areas, to scale.
    Drawing(Drawing),
    /// Panels of curves over time.
    Time(TimeFigure),
    /// Points or paths of one quantity against another.
    Xy(XyFigure),
    /// Counts of one quantity.
    Histogram(Histogram),
    /// Rows and columns of text.
    Table(Table),
    /// Findings, one sentence each.
    Findings(Findings),
    /// Alternative figures, shown one at a time.
    Choice(Choice),
    /// Lines of one quantity over another.
    Curves(Curves),
    /// Means in bins with their intervals.
    Intervals(Intervals),
    /// A signed quantity over two others.
    HeatMap(HeatMap),
    /// Horizontal bars from zero.
    Bars(Bars),
    /// Bars of evidence against thresholds.
    Evidence(Evidence),
    /// Values with their intervals.
    Whiskers(Whiskers),
    /// A table coloured by weight.
    Grid(Grid),
}

/// Outcome of a verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The goal was reached.
    Reached,
    /// A requirement was missed.
    Missed,
    /// There is no requirement, or it cannot be judged.
    Open,
}

/// Verdict in one sentence, with the details behind it.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Its outcome, shown as a word as well as a colour.
    pub outcome: Outcome,
    /// Why it is missed, beside the word of the outcome; empty if the sentence says so.
    pub reason: String,
    /// The verdict as one sentence.
    pub sentence: String,
    /// Shorter lines under it, in order.
    pub details: Vec<String>,
    /// The next command, ready to be copied; empty if none is known.
    pub next: String,
}

impl Verdict {
    pub(crate) fn html(&self) -> String {
        let (class, word) = match self.outcome {
            Outcome::Reached => ("reached", "Reached"),
            Outcome::Missed => ("missed", "Missed"),
            Outcome::Open => ("open", "Open"),
        };
        let details: String =
            self.details.iter().map(|d| format!("<li>{}</li>", escape(d))).collect();
        let list = if details.is_empty() { details } else { format!("<ul>{details}</ul>") };
        let reason = match self.reason.is_empty() {
            true => String::new(),
            false => format!(": {}", escape(&self.reason)),
        };
        format!(
            "<div class=\"verdict {class}\"><span class=\"outcome\">{word}{reason}</span><p>{}</p>{}{list}</div>\n",
            escape(&self.sentence),
            next_command(&self.next)
        )
    }
}

/// The next command as a line of a box; nothing if there is none.
pub(crate) fn next_command(next: &str) -> String {
    match next.is_empty() {
        true => String::new(),
        false => format!("<p class=\"rest\">Next: <code>{}</code></p>", escape(next)),
    }
}

/// Meaning of a line or point; the colours are distinguishable with colour blindness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// Commanded value: orange, dashed.
    Command,
    /// Actual value: blue.
    Actual,
    /// Second actual value: green.
    Second,
    /// Third actual value: purple.
    Third,
    /// Fourth actual value: ochre.
    Fourth,
    /// Measured value beside predicted ones: grey, and wide enough to be visible under them.
    Measured,
}

impl Style {
    /// Style of item `index` among items of one kind, such as models; the styles repeat after the
    /// fourth.
    pub fn nth(index: usize) -> Style {
        [Style::Actual, Style::Second, Style::Third, Style::Fourth][index % 4]
    }

    /// Name of the style in the style sheet.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Style::Command => "command",
            Style::Actual => "actual",
            Style::Second => "second",
            Style::Third => "third",
            Style::Fourth => "fourth",
            Style::Measured => "measured",
        }
    }
}

/// A straight line at one value, such as a budget or a percentile.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rule {
    /// Where, in the unit of the axis.
    pub value: f64,
    /// Name of the value, a word or two.
    pub label: String,
}
