//! The types of figures in a section of a page, and the styles of lines.

use serde::Serialize;

use crate::kit::html::escape;
use crate::{
    AnswerBox, Bars, Choice, Curves, Drawing, Evidence, Findings, Grid, HeatMap, Histogram,
    Intervals, Probabilities, Table, TimeFigure, Whiskers, XyFigure,
};

/// One figure of a section.
#[derive(Clone, Debug)]
pub enum Figure {
    /// Verdict in one sentence.
    Verdict(Verdict),
    /// The answer to the page's question.
    Answer(Box<AnswerBox>),
    /// A drawing of lines and areas, to scale.
    Drawing(Drawing),
    /// Panels of curves over time.
    Time(TimeFigure),
    /// Points or paths of one quantity against another.
    Xy(XyFigure),
    /// A histogram of one quantity.
    Histogram(Histogram),
    /// A table of texts in rows and columns.
    Table(Table),
    /// Findings, one sentence each.
    Findings(Findings),
    /// Alternative figures, of which one is visible at a time.
    Choice(Choice),
    /// Curves of one quantity as a function of another.
    Curves(Curves),
    /// Means of one quantity in bins of another, with their intervals.
    Intervals(Intervals),
    /// Map of a signed quantity over two other quantities.
    HeatMap(HeatMap),
    /// Horizontal bars from zero.
    Bars(Bars),
    /// Bars of evidence for effects, with thresholds.
    Evidence(Evidence),
    /// Bars of the probabilities of explanations.
    Probabilities(Probabilities),
    /// Values with their intervals.
    Whiskers(Whiskers),
    /// A table of numbers whose cells are coloured by their weight.
    Grid(Grid),
}

/// Outcome of a verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All requirements were met.
    Reached,
    /// A requirement was missed.
    Missed,
    /// The aircraft met all requirements, but the computer was late in some cycles.
    Late,
    /// There is no requirement, or the result is undetermined.
    Open,
    /// A check found nothing to correct.
    Sound,
    /// A check found something to correct.
    Faulty,
}

/// Verdict in one sentence, with details.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Outcome, shown as a word and by colour.
    pub outcome: Outcome,
    /// The requirements that were missed, or what the outcome rests on, shown next to the outcome; empty if the sentence states them.
    pub reason: String,
    /// The verdict as one sentence.
    pub sentence: String,
    /// Further lines below the sentence, in order.
    pub details: Vec<String>,
    /// What to do before the next command, such as "fly it, then"; empty if there is nothing.
    pub before_next: String,
    /// The next command for the user to run; empty if there is none.
    pub next: String,
}

impl Verdict {
    pub(crate) fn html(&self) -> String {
        let (class, word) = match self.outcome {
            Outcome::Reached => ("reached", "Reached"),
            Outcome::Missed => ("missed", "Missed"),
            Outcome::Late => ("late", "Reached"),
            Outcome::Open => ("open", "Open"),
            Outcome::Sound => ("reached", "Sound"),
            Outcome::Faulty => ("missed", "To correct"),
        };
        let details: String =
            self.details.iter().map(|d| format!("<li>{}</li>", escape(d))).collect();
        let list = if details.is_empty() { details } else { format!("<ul>{details}</ul>") };
        let joint = match self.outcome {
            Outcome::Late => ", but ",
            Outcome::Reached | Outcome::Sound => " ",
            _ => ": ",
        };
        let reason = match self.reason.is_empty() {
            true => String::new(),
            false => format!("{joint}{}", escape(&self.reason)),
        };
        format!(
            "<div class=\"verdict {class}\"><span class=\"outcome\">{word}{reason}</span><p>{}</p>{}{list}</div>\n",
            escape(&self.sentence),
            next_command_after(&self.before_next, &self.next)
        )
    }
}

/// The next command as a line of a box; empty if there is no command.
pub(crate) fn next_command(next: &str) -> String {
    next_command_after("", next)
}

/// The next command as a line of a box, with what to do before it.
fn next_command_after(before: &str, next: &str) -> String {
    let space = if before.is_empty() { "" } else { " " };
    match next.is_empty() {
        true => String::new(),
        false => format!(
            "<p class=\"rest\">Next: {}{space}<code>{}</code></p>",
            escape(before),
            escape(next)
        ),
    }
}

/// Meaning of a line or point. The colours are distinguishable with colour blindness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// Commanded value: orange, dashed.
    Command,
    /// First actual value: blue.
    Actual,
    /// Second actual value: green.
    Second,
    /// Third actual value: purple.
    Third,
    /// Fourth actual value: ochre.
    Fourth,
    /// Measured value: grey, and wide enough to be visible behind predicted values.
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

/// A straight line at one value of an axis, such as a budget or a percentile.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rule {
    /// Position of the line, in the unit of the axis.
    pub value: f64,
    /// Name of the line, one or two words.
    pub label: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_to_do_first_stands_before_the_next_command() {
        let said = |before: &str| next_command_after(before, "greylag amend");
        assert_eq!(said(""), next_command("greylag amend"));
        assert!(said("fly it, then").contains("Next: fly it, then <code>greylag amend</code>"));
        assert_eq!(next_command_after("fly it, then", ""), "");
    }
}
