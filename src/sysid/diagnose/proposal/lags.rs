//! Search for a formula of a missing effect (a physical contribution to forces and moments) in which controls pass through a
//! first-order lag.
//!
//! A form is a function of some variables; a formula is a sum of forms with coefficients. The forms of the library depend only on
//! present values. If a moment follows an engine or a flap with a lag, the library's formula contains the present control. It
//! then leaves a residual that is proportional to the rate of the control, which no form of the library contains.

use super::forward::{Ask, Climbed, candidates};
use super::library::{self, CONTROLS, Form};
use greylag_model::GreyBox;
use greylag_physics::Channel;
use greylag_physics::formula::Variable;

/// The lagged forms that are tried: lags of the controls in the library's formula `library`, and lags of all controls in the
/// channels `doubted` (forces or moments in which this formula leaves a residual).
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

/// Repeats the search with three kinds of forms: `lags`, those of the library's formula, and those that the flights cannot
/// distinguish from the formula's first term. `None` if the model cannot be evaluated over the flights.
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
