//! Findings as sentences, each with an optional link to its evidence.

use crate::kit::figure::next_command;
use crate::kit::html::escape;

/// A list of findings. Some of them are shown prominently.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    /// Prominent findings, which are shown first.
    pub lead: Vec<Finding>,
    /// Further findings, in order.
    pub rest: Vec<Finding>,
    /// The command that the user should run next; empty if there is none.
    pub next: String,
}

/// One finding in the form of a sentence.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The sentence, including its full stop.
    pub sentence: String,
    /// Link to the figure with the evidence; `None` if there is no link.
    pub link: Option<Link>,
}

/// A link to one alternative of a [`crate::Choice`], a figure in which the reader selects one of several alternatives.
#[derive(Clone, Debug)]
pub struct Link {
    /// HTML anchor of the choice.
    pub anchor: String,
    /// Name of the alternative.
    pub option: String,
}

impl Findings {
    pub(crate) fn html(&self) -> String {
        let lead: String = self.lead.iter().map(|f| format!("<p>{}</p>", f.html())).collect();
        let rest: String = self.rest.iter().map(|f| format!("<li>{}</li>", f.html())).collect();
        let list = if rest.is_empty() { rest } else { format!("<ul>{rest}</ul>") };
        format!("<div class=\"verdict findings\">{lead}{list}{}</div>\n", next_command(&self.next))
    }
}

impl Finding {
    fn html(&self) -> String {
        let sentence = escape(&self.sentence);
        match &self.link {
            None => sentence,
            Some(link) => format!(
                "{sentence} <a class=\"show\" href=\"#{}\" data-option=\"{}\">Show</a>",
                escape(&link.anchor),
                escape(&link.option)
            ),
        }
    }
}
