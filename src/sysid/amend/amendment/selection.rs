//! Forward selection of the effects that a user asks to add to a model. An effect is a group of model terms with coefficients.
//!
//! After each fit to the training flights, the model flies free runs (open-loop simulations) along held-out flights, which no
//! fit uses. An effect is accepted if the free-run errors decrease and its estimates pass the checks of [`judge`]. A convention
//! is a choice of integrator, force axes or air density.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::installation::Sensors;
use super::{Added, Options, joined};
use crate::amend::conventions::{Convention, Tried, closer};
use crate::amend::error::AmendError;
use crate::amend::flight::Flight;
use crate::amend::judge::{self, ACCEPTED_UNCONVERGED, Judge, Kept, settled};
use crate::amend::output_error::{self, Fit, FitOptions};
use crate::amend::parameters;
use crate::amend::result::AddedEffect;
use crate::compare::HorizonScore;
use crate::progress::{self, Progress, report};
use greylag_model::GreyBox;

/// Largest number of passes over the requested effects, and of passes over the conventions.
const ROUNDS: usize = 3;

/// The fit of the model with the effects accepted so far, and its free-run errors `after` on held-out flights.
#[derive(Clone)]
pub(super) struct Selection {
    /// The fit of the model without added effects, and its free-run errors on held-out flights.
    pub(super) tuned: (Fit, Vec<HorizonScore>),
    pub(super) fit: Fit,
    pub(super) after: Vec<HorizonScore>,
    /// The accepted effects, in the order of acceptance.
    accepted: Vec<Added>,
    /// The outcome for every requested effect.
    pub(super) effects: Vec<AddedEffect>,
}

/// Inputs of the selection: options, training flights, and a judge with the held-out flights.
pub(super) struct Ask<'a> {
    pub(super) options: &'a Options,
    pub(super) train: &'a [Flight],
    pub(super) judge: &'a Judge<'a>,
    pub(super) progress: &'a Progress<'a>,
    /// Number of fits that have begun. The first of them is the fit without added effects.
    pub(super) begun: AtomicUsize,
    /// Decision whether sensor errors that all flights have in common become constants of the installation. It is made after the
    /// first fit.
    pub(super) sensors: OnceLock<Sensors>,
}

impl Ask<'_> {
    /// Selects the effects that improve `model`. Effects with starting values, which come from a diagnosis, are first tried
    /// jointly. All effects that are not accepted then are tried one by one.
    pub(super) fn selected(&self, model: &GreyBox) -> Result<Selection, AmendError> {
        let tuned = match &self.options.tuned {
            Some(known) => self.with_sensors(known.clone(), model),
            None => self.fit(model, &FitOptions::default())?,
        };
        let scores = self.judge.scores(&tuned.model);
        let mut first = Selection {
            tuned: (tuned.clone(), scores.clone()),
            fit: tuned,
            after: scores,
            accepted: Vec::new(),
            effects: Vec::new(),
        };
        if let Some((together, kept)) = self.together(model, &first.tuned)? {
            first.accepted = together.into_iter().cloned().collect();
            let joined = first.accepted.iter().map(|a| AddedEffect::asked_for(&a.id));
            first.effects = joined.map(|e| AddedEffect { joined: true, ..e }).collect();
            (first.fit, first.after) = kept;
        }
        self.rest(model, first)
    }

    /// Tries, one by one, the requested effects that are not in the selection `so_far`. A rejected effect is tried again after
    /// another effect has been accepted.
    fn rest(&self, model: &GreyBox, so_far: Selection) -> Result<Selection, AmendError> {
        let Options { effects, refused, .. } = self.options;
        let mut best = (so_far.fit, so_far.after);
        let mut accepted: Vec<&Added> = so_far.accepted.iter().collect();
        // each verdict is paired with the number of other effects that were accepted when it was reached; this number is 0
        // for the effects that were accepted jointly
        let verdict = |added: &Added| {
            let tried = so_far.effects.iter().find(|e| e.id == added.id && e.joined);
            tried.map(|tried| (tried.clone(), 0))
        };
        let mut verdicts: Vec<Option<(AddedEffect, usize)>> = effects.iter().map(verdict).collect();
        for _ in 0..ROUNDS {
            for (added, verdict) in effects.iter().zip(&mut verdicts) {
                let beside = accepted.len();
                if verdict.as_ref().is_some_and(|(e, asked)| e.joined || *asked == beside)
                    || accepted.iter().any(|a| a.id == added.id)
                {
                    continue;
                }
                accepted.push(added);
                let fitted = self.with_effects(model, &accepted, &best.0.model);
                let (effect, kept) = self.judge.verdict(added, fitted, &best.1, *refused)?;
                match kept {
                    Some(kept) => best = kept,
                    None => drop(accepted.pop()),
                }
                *verdict = Some((effect, beside));
            }
        }
        let effects = verdicts.into_iter().flatten().map(|(effect, _)| effect).collect();
        let accepted = accepted.into_iter().cloned().collect();
        Ok(Selection { tuned: so_far.tuned, fit: best.0, after: best.1, accepted, effects })
    }

    /// Fits all effects with starting values jointly, and leaves out those with implausible estimates. `best` is the fit without
    /// added effects. Returns the remaining effects, their fit and its free-run errors on held-out flights.
    ///
    /// If the model lacks two effects, the error due to one can hide the gain of adding the other. A test of the other effect
    /// alone would then fail. Returns `None` if a fit fails, if fewer than two effects remain, or if the held-out error does not
    /// decrease by more than 1 %.
    fn together(
        &self,
        model: &GreyBox,
        best: &Kept,
    ) -> Result<Option<(Vec<&Added>, Kept)>, AmendError> {
        let mut all: Vec<&Added> =
            self.options.effects.iter().filter(|a| a.start.is_some()).collect();
        let fitted = |all: &[&Added]| -> Result<Option<Kept>, AmendError> {
            let fit = settled(self.with_effects(model, all, &best.0.model))?;
            Ok(fit.map(|fit| {
                let scores = self.judge.scores(&fit.model);
                (fit, scores)
            }))
        };
        if all.len() < 2 {
            return Ok(None);
        }
        let Some(mut kept) = fitted(&all)? else { return Ok(None) };
        // effects that are confounded with a coefficient of the model are left out unless the error is lower with them,
        // because they would widen the intervals of all estimates
        let mut fewer = all.clone();
        fewer.retain(|a| !judge::doubled(&a.id, &kept.0.parameters));
        if fewer.len() < all.len()
            && let Some(other) = fitted(&fewer)?
            && !judge::better(&kept.1, &other.1)
        {
            (all, kept) = (fewer, other);
        }
        while all.len() > 1 {
            let mut left = all.clone();
            left.retain(|a| judge::objections(&a.id, &kept.0.parameters).is_empty());
            if left.len() == all.len() {
                return Ok(judge::better(&kept.1, &best.1).then_some((all, kept)));
            }
            all = left;
            if all.len() < 2 {
                break;
            }
            let Some(other) = fitted(&all)? else { break };
            kept = other;
        }
        Ok(None)
    }

    /// Tries the alternative to each convention of `model`, one by one. A rejected alternative is tried again after another one
    /// has been adopted. `best` is the selection with the conventions of `model`.
    pub(super) fn with_conventions(
        &self,
        model: &GreyBox,
        mut best: Selection,
    ) -> Result<(Selection, Vec<Tried>), AmendError> {
        let mut base = model.clone();
        // each verdict is paired with the number of alternatives that had been adopted when it was reached
        let mut verdicts: [Option<(Tried, usize)>; Convention::ALL.len()] = Default::default();
        for _ in 0..ROUNDS {
            for (k, convention) in Convention::ALL.into_iter().enumerate() {
                let beside = verdicts.iter().flatten().filter(|(t, _)| t.kept).count();
                if verdicts[k].as_ref().is_some_and(|(t, asked)| t.kept || *asked == beside) {
                    continue;
                }
                let Some(other) = convention.other(&base) else { continue };
                let (from, to) = (convention.of(&base), convention.of(&other));
                let doing = format!("{}: {to} instead of {from}", model.name);
                report(self.progress, &doing, self.done()[0])?;
                let tried = self.under(&other, &best)?;
                let closer = tried.as_ref().map_or(f64::NAN, |t| closer(&best.fit, &t.fit));
                let error = [best.error(), tried.as_ref().map_or(f64::NAN, Selection::error)];
                let taken = tried.filter(|t| {
                    let settled =
                        t.fit.unsettled.is_none() || error[1] < ACCEPTED_UNCONVERGED * error[0];
                    settled && convention.is_borne_out(closer, error)
                });
                let kept = taken.is_some();
                let tried = Tried { convention, from, to, error, closer, kept };
                verdicts[k] = Some((tried, beside));
                if let Some(taken) = taken {
                    (best, base) = (taken, other);
                }
            }
        }
        Ok((best, verdicts.into_iter().flatten().map(|(tried, _)| tried).collect()))
    }

    /// The selection for `other`, the model with another convention. It starts with the effects accepted in `best`, which are
    /// fitted again. The other requested effects are tried again only if the error on held-out flights or the residuals of the
    /// fit decrease. `None` if the fit fails.
    fn under(&self, other: &GreyBox, best: &Selection) -> Result<Option<Selection>, AmendError> {
        let joined: Vec<&Added> = best.accepted.iter().collect();
        let Some(fit) = settled(self.with_effects(other, &joined, &best.fit.model))? else {
            return Ok(None);
        };
        let after = self.judge.scores(&fit.model);
        let same = Selection { fit, after, ..best.clone() };
        let promises = same.error() < best.error() || closer(&best.fit, &same.fit) > 0.0;
        match promises {
            true => self.rest(other, same).map(Some),
            false => Ok(Some(same)),
        }
    }

    /// Fits `model` with `effects` added. The coefficients of an effect that `near` has start at their values in `near`.
    fn with_effects(
        &self,
        model: &GreyBox,
        effects: &[&Added],
        near: &GreyBox,
    ) -> Result<Fit, AmendError> {
        let mut model = model.clone();
        for added in effects {
            let own = format!("{}.", added.id);
            let fitted = near.coefficients().iter().filter(|c| c.name.starts_with(&own));
            let fitted: Vec<f64> = fitted.map(|c| c.value).collect();
            // the starting values of a curve (an effect given by ordinates) are its prior means and must not come from a fit
            let start = match fitted.is_empty() || parameters::SLIGHT.contains(&added.id.as_str()) {
                true => added.start.clone(),
                false => Some(fitted),
            };
            joined(&mut model, &Added { id: added.id.clone(), start })?;
            model.name = format!("{}+{}", model.name, added.id);
        }
        let added = effects.iter().map(|a| a.id.clone()).collect();
        let options = FitOptions { added, ..FitOptions::default() };
        self.fit(&model, &options)
    }

    /// Fits `model` to the training flights, and reports the progress as a fraction of the whole selection.
    fn fit(&self, model: &GreyBox, options: &FitOptions) -> Result<Fit, AmendError> {
        let progress = progress::part(self.progress, self.done());
        self.begun.fetch_add(1, Ordering::Relaxed);
        let per_flight = self.options.per_flight;
        let options = FitOptions { per_flight, ..options.clone() };
        let fit = output_error::fit(model, self.train, &options, &progress)?;
        Ok(self.with_sensors(fit, model))
    }

    /// Returns `fit`, a fit of `model`, after the decision on common sensor errors ([`Ask::sensors`]) was applied to it.
    fn with_sensors(&self, mut fit: Fit, model: &GreyBox) -> Fit {
        let asked = &self.options.per_flight;
        let decided = self.sensors.get_or_init(|| Sensors::decided(asked, model, &fit, self.judge));
        decided.apply(&mut fit, model);
        fit
    }

    /// Estimated fractions of the whole selection that are complete before and after the next fit. They are limited to 0.98,
    /// because some effects are tried more than once.
    fn done(&self) -> [f64; 2] {
        let begun = self.begun.load(Ordering::Relaxed) as f64;
        let planned = 1.0 + self.options.effects.len() as f64;
        [begun, begun + 1.0].map(|fits| (fits / planned).min(0.98))
    }
}

impl Selection {
    /// Error of the free runs on held-out flights, at the longest horizon up to 5 s that a run reaches. NaN if no run reaches any
    /// horizon.
    fn error(&self) -> f64 {
        judge::judged(&self.after).unwrap_or(f64::NAN)
    }
}
