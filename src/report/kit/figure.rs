//! The kinds of figure a section may hold.

use serde::Serialize;

use crate::kit::html::escape;
use crate::{
    Bars, Choice, Curves, Evidence, Findings, Grid, HeatMap, Histogram, Intervals, Table,
    TimeFigure, Whiskers, XyFigure,
};

/// One figure of a section.
#[derive(Clone, Debug)]
pub enum Figure {
    /// A sentence that says how it went.
    Verdict(Verdict),
    /// Panels over time.
    Time(TimeFigure),
    /// Points or paths of one quantity against another.
    Xy(XyFigure),
    /// Counts of one quantity.
    Histogram(Histogram),
    /// Rows and columns of text.
    Table(Table),
    /// Sentences that say what was found.
    Findings(Findings),
    /// Alternatives of which one is seen.
    Choice(Choice),
    /// Lines over a quantity, by decades.
    Curves(Curves),
    /// Means in bins.
    Intervals(Intervals),
    /// A signed quantity over two others.
    HeatMap(HeatMap),
    /// Horizontal bars.
    Bars(Bars),
    /// Bars against thresholds.
    Evidence(Evidence),
    /// Values with intervals.
    Whiskers(Whiskers),
    /// A table coloured by weight.
    Grid(Grid),
}

/// How a verdict came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// What was asked for was reached.
    Reached,
    /// Something that was asked for was missed.
    Missed,
    /// Nothing was asked for, or it cannot be determined.
    Open,
}

/// A sentence that says how it went, with the details that bear it out.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// How it came out; shown as a word as well as a colour.
    pub outcome: Outcome,
    /// The sentence.
    pub sentence: String,
    /// Shorter lines under it, in order.
    pub details: Vec<String>,
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
        format!(
            "<div class=\"verdict {class}\"><span class=\"outcome\">{word}</span><p>{}</p>{list}</div>\n",
            escape(&self.sentence)
        )
    }
}

/// What a line or a point stands for; each has a colour that a colour-blind reader can tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// What was asked for: orange, dashed.
    Command,
    /// What happened: blue.
    Actual,
    /// A second thing that happened: green.
    Second,
    /// A third thing that happened: purple.
    Third,
    /// A fourth: ochre.
    Fourth,
    /// What was measured, where others were predicted: grey, and wide enough to be seen under them.
    Measured,
}

impl Style {
    /// Of several alike, such as models, the one at `index`; they repeat after the fourth.
    pub fn nth(index: usize) -> Style {
        [Style::Actual, Style::Second, Style::Third, Style::Fourth][index % 4]
    }

    /// Its name in the style sheet.
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
    /// What it is, a word or two.
    pub label: String,
}
