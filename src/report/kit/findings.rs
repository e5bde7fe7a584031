//! Findings as sentences, each with an optional link to its evidence.

use crate::kit::figure::next_command;
use crate::kit::html::escape;

/// A list of findings, of which the leading ones are prominent.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    /// Prominent findings.
    pub lead: Vec<Finding>,
    /// Further findings, in order.
    pub rest: Vec<Finding>,
    /// The next command for the user to run; empty if there is none.
    pub next: String,
}

/// One finding, as a sentence.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The sentence, including its full stop.
    pub sentence: String,
    /// The figure with the evidence; `None` for a sentence without a link.
    pub link: Option<Link>,
}

/// A link to one alternative of a [`crate::Choice`].
#[derive(Clone, Debug)]
pub struct Link {
    /// Anchor of the choice.
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
