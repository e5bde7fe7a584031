//! Alternative figures, of which one is visible at a time.

use crate::Figure;
use crate::kit::html::escape;

/// Named alternatives with a row of buttons; choices with the same label switch together.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Anchor for links: letters and hyphens, unique on the page.
    pub anchor: String,
    /// Name of the choice, for example `Channel`.
    pub label: String,
    /// The alternatives; the first is visible initially. Without scripts, a browser shows all of them.
    pub options: Vec<ChoiceOption>,
}

/// One alternative of a choice.
#[derive(Clone, Debug)]
pub struct ChoiceOption {
    /// Label of the button.
    pub name: String,
    /// Figures of the alternative.
    pub figures: Vec<Figure>,
}

impl Choice {
    pub(crate) fn html(&self, data: &mut Vec<String>) -> String {
        let (anchor, label) = (escape(&self.anchor), escape(&self.label));
        let mut html = format!("<div class=\"choice\" id=\"{anchor}\" data-label=\"{label}\">\n");
        if self.options.len() > 1 {
            let button = |o: &ChoiceOption| {
                let name = escape(&o.name);
                format!(
                    "<button type=\"button\" data-option=\"{name}\" aria-pressed=\"false\">\
                     {name}</button>"
                )
            };
            let buttons: String = self.options.iter().map(button).collect();
            html.push_str(&format!(
                "<div class=\"options\" role=\"group\" aria-label=\"{label}\">\
                 <span class=\"unit\">{label}</span>{buttons}</div>\n"
            ));
        }
        for option in &self.options {
            let name = escape(&option.name);
            html.push_str(&format!(
                "<div class=\"option\" data-option=\"{name}\"><h3 class=\"chosen\">{name}</h3>\
                 <div class=\"figures\">\n"
            ));
            for figure in &option.figures {
                html.push_str(&figure.html(data));
            }
            html.push_str("</div></div>\n");
        }
        html.push_str("</div>\n");
        html
    }
}
