//! Search for a formula of a missing effect in which controls act through a first-order lag. An effect is a physical contribution
//! to forces and moments.
//!
//! A form is a function of some variables. A formula is a sum of forms with coefficients. The library is a set of forms that
//! depend only on present values. A first search with these forms yields an unlagged formula. If a moment follows an engine or a
//! flap with a lag, this formula contains the present control. It then leaves a residual that is proportional to the rate of the
//! control. No form of the library can represent this residual.

use super::forward::{Ask, Climbed, candidates};
use super::library::{self, CONTROLS, Form};
use greylag_model::GreyBox;
use greylag_physics::Channel;
use greylag_physics::formula::Variable;

/// The lagged forms to try: a lag of each control that the unlagged formula `library` contains, and lags of all controls in the
/// channels `doubted`. These are the forces or moments in which the formula leaves a residual.
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

/// Repeats the search. The candidates are the lagged forms `lags`, the forms of the unlagged formula `library`, and the forms
/// that the flights cannot distinguish from its first term. `None` if the model cannot be evaluated over the flights.
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
