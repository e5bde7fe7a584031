//! Decides whether a model keeps the fitted constants of the installation: sensor errors and misalignment angles that all flights
//! of the aircraft have in common. The decision depends on the error of free runs over held-out flights, which the fit does not
//! use.

use std::sync::Arc;

use crate::amend::judge::{self, IMPROVED, Judge};
use crate::amend::learned;
use crate::amend::output_error::Fit;
use crate::compare::HorizonScore;
use crate::per_flight::{PerFlight, SensorErrors};
use greylag_model::{FlightConstants, GreyBox};

/// Decision on the sensor errors that the fitted flights have in common.
#[derive(Clone, Debug)]
pub(super) struct Sensors {
    /// Whether they are kept as errors of the installation.
    keep: bool,
    /// Whether the fit has estimated the misalignment of the axes, so that it did not use the installation of the model before it.
    anew: bool,
    /// Note on the decision; `None` if the flights have no such errors in common.
    pub(super) note: Option<String>,
}

impl Sensors {
    /// Decides from `fit`, the fit of the model `given` without added effects. The sensor errors are kept if they lower the
    /// held-out error by at least the fraction `IMPROVED`. If `asked` has `SensorErrors::Kept`, they are kept unless they raise it.
    pub(super) fn decided(asked: &PerFlight, given: &GreyBox, fit: &Fit, judge: &Judge) -> Sensors {
        let anew = asked.angles() > 0;
        let before = given.known.installation.as_ref();
        let after = fit.model.known.installation.as_ref();
        let words = after.and_then(|after| learned::sensors_in_words(before, after));
        let Some(words) = words else { return Sensors { keep: true, anew, note: None } };
        let errors = judge::judged(&judge.scores(&fit.model))
            .zip(judge::judged(&judge.scores(&without_sensors(&fit.model, given, anew))))
            .filter(|(a, b)| !a.is_nan() && !b.is_nan());
        let least = match asked.sensors {
            SensorErrors::Kept => 0.0,
            SensorErrors::Judged | SensorErrors::Dropped => IMPROVED,
        };
        let keep = errors.is_some_and(|(with, without)| with <= (1.0 - least) * without);
        let found = format!("The fitted flights have sensor errors in common ({words})");
        Sensors { keep, anew, note: Some(note(&found, errors, keep)) }
    }

    /// Removes the common sensor errors from the model of `fit`, unless they are kept. `given` is the model before the fit.
    pub(super) fn apply(&self, fit: &mut Fit, given: &GreyBox) {
        if !self.keep {
            fit.model = without_sensors(&fit.model, given, self.anew);
        }
    }
}

/// Returns `fitted` with the sensor errors of `given` in place of the estimated ones. If the fit has estimated the
/// misalignment (`anew`), the result has no sensor errors, because such a fit does not use those of `given`.
fn without_sensors(fitted: &GreyBox, given: &GreyBox, anew: bool) -> GreyBox {
    let mut bare = fitted.clone();
    let known = Arc::make_mut(&mut bare.known);
    known.installation = match anew {
        true => known.installation.take().filter(|own| own.axes_deg.is_some()),
        false => given.known.installation.clone(),
    };
    if let Some(own) = known.installation.as_mut().filter(|_| anew) {
        own.sensors = None;
    }
    bare
}

/// Decides whether the fitted model keeps the misalignment of the axes that is common to all flights. Returns the fit, its
/// held-out scores and a note on the decision.
///
/// The misalignment is kept if it does not increase the held-out error. It is removed if the error increases or is unknown.
pub(super) fn aligned(
    mut fit: Fit,
    after: Vec<HorizonScore>,
    judge: &Judge,
) -> (Fit, Vec<HorizonScore>, Option<String>) {
    let Some(shared) = fit.model.known.installation.clone() else { return (fit, after, None) };
    if shared.axes_deg.is_none() {
        return (fit, after, None);
    }
    let with = fit.model.known.clone();
    let left = FlightConstants { axes_deg: None, ..shared.clone() };
    Arc::make_mut(&mut fit.model.known).installation = left.sensors.is_some().then_some(left);
    let bare = judge.scores(&fit.model);
    let errors = judge::judged(&after).zip(judge::judged(&bare));
    let errors = errors.filter(|(a, b)| !a.is_nan() && !b.is_nan());
    let keep = errors.is_some_and(|(with, without)| with <= without);
    let words = learned::in_words(&shared);
    let found =
        format!("The measured axes of the fitted flights have a common misalignment ({words})");
    let note = note(&found, errors, keep);
    if keep {
        fit.model.known = with;
        return (fit, after, Some(note));
    }
    (fit, bare, Some(note))
}

/// Note that begins with the constants `found`. `errors` are the scaled held-out errors with and without them; `None` if they
/// are unknown.
fn note(found: &str, errors: Option<(f64, f64)>, keep: bool) -> String {
    let Some((a, b)) = errors else {
        return format!("{found}. No held-out flight can validate this, so it is not kept.");
    };
    let said = if keep { "kept as [installation]" } else { "not kept" };
    format!("{found}: {said}. The error of the free runs is {a:.5} with it, {b:.5} without.")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_states_the_decision_and_both_errors() {
        let kept = note("Found", Some((0.1, 0.2)), true);
        assert_eq!(
            kept,
            "Found: kept as [installation]. The error of the free runs is 0.10000 with it, 0.20000 without."
        );
        assert!(note("Found", Some((0.2, 0.1)), false).contains("not kept"));
        assert!(note("Found", None, false).contains("No held-out flight"));
    }
}
