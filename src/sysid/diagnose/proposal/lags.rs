//! Candidates with controls through a first-order lag, in addition to the library's formula.
//!
//! The shapes of the library depend only on present values. A moment that follows an engine or a flap with a delay is
//! therefore fitted with the present control. The residual then follows the rate of the control, which no shape contains.

use super::forward::{Ask, Climbed, candidates};
use super::library::{self, CONTROLS, Form};
use greylag_model::GreyBox;
use greylag_physics::Channel;
use greylag_physics::formula::Variable;

/// The lagged forms that are tried: lags of the controls in the library's formula, and lags of all controls in the
/// channels `doubted`, in which the formula leaves a residual.
pub(super) fn forms(library: &Climbed, doubted: &[Channel]) -> Vec<Form> {
    let mut all: Vec<Form> = Vec::new();
    for term in &library.terms {
        let own: Vec<Variable> = term.form.shape.variables();
        all.extend(library::lags(term.form.channel, &own));
    }
    all.extend(doubted.iter().flat_map(|channel| library::lags(*channel, &CONTROLS)));
    let mut kept: Vec<Form> = Vec::new();
    all.into_iter().for_each(|form| {
        if !kept.contains(&form) {
            kept.push(form);
        }
    });
    kept
}

/// Repeats the search with the forms `lags`, the library's terms, and the forms that are indistinguishable from the
/// first term. `None` if the model cannot be evaluated over the flights.
pub(super) fn climb(
    ask: &Ask,
    library: &Climbed,
    lags: Vec<Form>,
    tuned: &GreyBox,
) -> Option<Climbed> {
    let own = library.terms.iter().map(|t| t.form).chain(library.class.iter().copied());
    let forms = candidates(own.chain(lags));
    Ask { forms: &forms, ..*ask }.climb(tuned.clone())
}
