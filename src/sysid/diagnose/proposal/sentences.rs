//! Wording of a proposal, which is a formula for an effect outside the catalogue of known effects.
//!
//! The sentences are on the formula, its certain properties, the free forms and the test on held-out flights, which the search
//! did not use. A free form is a formula that is composed from functions instead of taken from the library of formulas.

use super::draft::Term;
use super::free::grammar::MOST_NODES;
use super::grades;
use super::library;
use super::result::{HeldOut, Proposal};
use crate::text::figures;
use greylag_physics::formula::Variable;

/// `text` with an upper-case first letter and a full stop.
pub(super) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |c| c.to_uppercase().chain(letters).collect()) + "."
}

/// Describes the proposal in sentences: its terms, their certain properties, the free forms, the test.
pub(super) fn sentences(
    proposal: &Proposal,
    first: &Term,
    terms: &[Term],
    tested: &HeldOut,
) -> Vec<String> {
    let mut said: Vec<String> = Vec::new();
    for term in terms {
        let unit = term.form.unit();
        let at = match (&term.form.shape, term.form.of_air) {
            (library::Shape::Linear(Variable::Throttle), false) => " at full throttle",
            _ => "",
        };
        said.push(format!(
            "{} {} ± {}{}{at} ({} = k*{}{}).",
            capital(&grades::words(&term.form, term.value)).trim_end_matches('.').to_owned() + ":",
            figures(term.value),
            figures(term.sd),
            if unit.is_empty() { String::new() } else { format!(" {unit}") },
            greylag_physics::formula::file::channel_name(term.form.channel),
            if term.form.of_air { format!("{}*", term.form.factor()) } else { String::new() },
            term.form.shape.text(None)
        ));
    }
    if let Some(g) = proposal.grades {
        let sure = [
            ("channel", g.channel),
            ("variables", g.variables),
            ("trend", g.trend),
            ("form", g.form),
        ];
        let of = |wanted: bool| {
            let all: Vec<&str> =
                sure.iter().filter(|(_, s)| *s == wanted).map(|(n, _)| *n).collect();
            all.join(", ")
        };
        said.push(match (of(true), of(false)) {
            (sure, open) if open.is_empty() => {
                format!("Sure of {}: {sure}.", grades::amount(first.form.channel))
            }
            (sure, open) => {
                let sure = if sure.is_empty() { "nothing" } else { sure.as_str() };
                let alike = proposal.alike.iter().take(3).map(|a| a.formula.as_str());
                let alike = alike.collect::<Vec<_>>().join(" or ");
                match alike.is_empty() {
                    true => format!("Sure: {sure}. Open: {open}."),
                    false => {
                        format!(
                            "Sure: {sure}. Open: {open}; these flights cannot tell it from {alike}."
                        )
                    }
                }
            }
        });
    }
    if let Some(free) = &proposal.free {
        let found = match free.chosen {
            true => "one of them is in the formula above",
            false => {
                "none of them is better than the library's by more than a hundredth, or simpler"
            }
        };
        said.push(format!(
            "{}, so {} free forms of at most {MOST_NODES} nodes were tried: {found}.",
            capital(&free.why).trim_end_matches('.'),
            free.tried
        ));
    }
    let verdict = match proposal.refused.is_empty() {
        true => "it is proposed".to_owned(),
        false => format!("it is not proposed, for {}", proposal.refused.join("; ")),
    };
    said.push(format!(
        "On {}, which the search has not seen, it removes {:.0} % of the error beyond noise (fall {:.0}, by chance \
         {:.0}): {verdict}.",
        tested.flights.join(", "),
        100.0 * tested.removed,
        tested.fall,
        tested.threshold
    ));
    said
}
