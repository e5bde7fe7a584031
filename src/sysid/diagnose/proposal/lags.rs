//! Controls through a first-order lag, where the library's formula has them at once or leaves something.
//!
//! The shapes of the library know the present alone. A moment behind an engine or a flap that takes time looks to them like
//! the control itself, and what is left goes with its rate, which no shape holds.

use super::forward::{Ask, Climbed, candidates};
use super::library::{self, CONTROLS, Form};
use greylag_model::GreyBox;
use greylag_physics::Channel;
use greylag_physics::formula::Variable;

/// The lags that are worth their time beside the library's formula: those of its own controls, and of all controls in the
/// channels `doubted`, where it leaves something.
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

/// The search once more with `lags` beside what the library's search found and could not tell from it. `None` if the
/// flights do not hold the model.
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
