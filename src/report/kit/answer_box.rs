//! Box with the answer of a page on a model's error in free runs (open-loop simulations). It states how the error changes, which
//! effects are missing, where the model fails, and the next command.

use crate::kit::figure::next_command;
use crate::kit::html::escape;
use greylag_sysid::compare::Answer;

/// Definition of the error, which every box contains.
const ERROR: &str = "Error: root mean square over the eight states of a free run on the recorded actuators, each state over its \
                     characteristic value x_c (NRMSE).";

/// Box with the answer to the page's question.
#[derive(Clone, Debug)]
pub struct AnswerBox {
    /// The answer that the box shows.
    pub answer: Answer,
    /// Sentence on where the model fails; empty if this is not known.
    pub place: String,
    /// The first sentence of the box.
    pub first: First,
}

/// Choice of the first sentence in the box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum First {
    /// The change of the error.
    Error,
    /// The sentence on missing effects. It comes first if no effect is missing: the error then falls only because the
    /// coefficients were re-estimated.
    Effect,
}

impl AnswerBox {
    pub(crate) fn html(&self) -> String {
        let Answer { error, effect, acts, left, next, .. } = &self.answer;
        let line = |class: &str, text: &str| match text.is_empty() {
            true => String::new(),
            false => format!("<p{class}>{}</p>", escape(text)),
        };
        let next = next_command(next);
        let [one, two] = match self.first {
            First::Error => [error, effect],
            First::Effect => [effect, error],
        };
        format!(
            "<div class=\"verdict answer{}\">{}{}{}{}{}{next}{}</div>\n",
            self.tone(),
            line("", one),
            line("", two),
            line("", acts),
            line(" class=\"rest\"", &self.place),
            line(" class=\"rest\"", left),
            line(" class=\"how\"", ERROR)
        )
    }

    /// CSS class for the colour of the box. It is empty if the sentence on the error comes first and the error falls, unless a
    /// forecast without aerodynamics is still better.
    fn tone(&self) -> &'static str {
        let change = self.answer.numbers.change_percent;
        match self.first {
            First::Effect => " open",
            First::Error if self.answer.behind_baseline() => " missed",
            First::Error if change < 0.0 && self.answer.gains_nothing() => " open",
            First::Error if change < 0.0 => "",
            First::Error if change > 0.0 => " missed",
            First::Error => " open",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(change_percent: f64) -> Answer {
        let mut answer = Answer { error: "fell".into(), ..Answer::nothing() };
        answer.numbers.change_percent = change_percent;
        answer.with_effect("nothing is missing".into()).then("greylag diagnose".into())
    }

    #[test]
    fn the_box_is_green_only_where_the_error_falls() {
        let html = |change, first| {
            AnswerBox { answer: answer(change), place: "Where it fails: lift.".into(), first }
                .html()
        };
        assert!(html(-50.0, First::Error).starts_with("<div class=\"verdict answer\">"));
        assert!(html(5.0, First::Error).starts_with("<div class=\"verdict answer missed\">"));
        // there is no change for a single model
        assert!(html(f64::NAN, First::Error).starts_with("<div class=\"verdict answer open\">"));
    }

    #[test]
    fn where_nothing_is_missing_that_is_said_first() {
        let said = |first| {
            let boxed =
                AnswerBox { answer: answer(5.0), place: "Where it fails: lift.".into(), first };
            let html = boxed.html();
            ["nothing is missing", "fell", "Where it fails: lift.", "Next: "]
                .map(|part| html.find(part).expect(part))
        };
        assert!(said(First::Effect).is_sorted());
        let [effect, error, place, next] = said(First::Error);
        assert!([error, effect, place, next].is_sorted());
    }
}
