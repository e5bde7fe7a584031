//! The box with the answer: sentences in large type, the remaining error, the command to run next.

use crate::kit::html::escape;
use greylag_sysid::compare::Answer;

/// Definition of the error, printed once on every page.
const ERROR: &str = "Error: root mean square over the eight states of a free run on the recorded actuators, each state over its \
                     characteristic value x_c (NRMSE).";

/// Box with the answer to the page's question.
#[derive(Clone, Debug)]
pub struct AnswerBox {
    /// The answer that the box shows.
    pub answer: Answer,
}

impl AnswerBox {
    pub(crate) fn html(&self) -> String {
        let Answer { error, effect, left, next, .. } = &self.answer;
        let line = |class: &str, text: &str| match text.is_empty() {
            true => String::new(),
            false => format!("<p{class}>{}</p>", escape(text)),
        };
        let next = match next.is_empty() {
            true => String::new(),
            false => format!("<p class=\"rest\">Next: <code>{}</code></p>", escape(next)),
        };
        format!(
            "<div class=\"verdict answer\">{}{}{}{next}{}</div>\n",
            line("", error),
            line("", effect),
            line(" class=\"rest\"", left),
            line(" class=\"how\"", ERROR)
        )
    }
}
