//! The amendment: the prior tuned, effects added one after the other, each judged on unseen flights.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::conventions::{Convention, Tried, closer};
use super::error::AmendError;
use super::flight::Flight;
use super::judge::{self, JUDGED_AT_S, Judge, Kept, SETTLED_OR_NOT, settled};
use super::output_error::{self, Fit, FitOptions};
use super::parameters;
use super::result::{AddedEffect, Amendment, Settings};
use super::story;
use crate::model::GreyBox;
use crate::physics::catalogue;
use crate::physics::effects::{Coefficient, Description, Kind};
use crate::sysid::compare::HorizonScore;
use crate::sysid::diagnose::Candidate;
use crate::sysid::flight_path::reconstruction::{Reconstruction, Segment};
use crate::sysid::progress::{self, Progress, say};
use crate::sysid::rudder;

/// Times that all effects are asked for at most.
const ROUNDS: usize = 3;

/// An effect to add.
#[derive(Clone, Debug, PartialEq)]
pub struct Added {
    /// Its id.
    pub id: String,
    /// Values of its coefficients near which to search, where known.
    pub start: Option<Vec<f64>>,
}

impl Added {
    /// A candidate of a diagnosis, to be searched for near where the diagnosis has it.
    pub fn of(candidate: &Candidate) -> Added {
        let of = |name: &str| candidate.parameters.iter().find(|p| p.name == name);
        Added::near(&candidate.id, |name| of(name).map(|p| p.value))
    }

    /// The effect `id`, to be searched for near `value` of its coefficients' names, if that knows them all.
    pub fn near(id: &str, value: impl Fn(&str) -> Option<f64>) -> Added {
        let coefficients = catalogue::describe(id).map(|about| about.coefficients);
        let start = coefficients.and_then(|all| all.iter().map(|c| value(c.name)).collect());
        Added { id: id.into(), start }
    }
}

/// What becomes of an effect that the data refuse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// It is left out of the model.
    Left,
    /// It stays in the model all the same.
    Kept,
}

/// What is known of the model's coefficients before the flights are seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prior {
    /// The values of its file, with their standard deviations.
    #[default]
    File,
    /// What is physically possible.
    Bounds,
}

/// What an amendment is asked for.
#[derive(Clone, Debug)]
pub struct Options {
    /// Effects to add, in this order; none to tune the prior only.
    pub effects: Vec<Added>,
    /// What is known of the coefficients beforehand.
    pub prior: Prior,
    /// What becomes of those that the data refuse.
    pub refused: Refused,
    /// Horizons of the free runs, s.
    pub horizons_s: Vec<f64>,
    /// Whether the model's other conventions are tried too.
    pub conventions: bool,
    /// The model tuned to the same flights without any effect ([`tune`](super::tune)), where that is known already.
    pub tuned: Option<Fit>,
}

impl Options {
    /// Horizon at which improvement is judged, s.
    pub const JUDGED_AT_S: f64 = JUDGED_AT_S;
}

impl Default for Options {
    fn default() -> Self {
        let horizons_s = vec![1.0, 2.0, JUDGED_AT_S, 10.0];
        Options {
            effects: Vec::new(),
            prior: Prior::File,
            refused: Refused::Left,
            horizons_s,
            conventions: false,
            tuned: None,
        }
    }
}

/// An amendment with the models it is about.
#[derive(Clone, Debug)]
pub struct Amended {
    /// The story.
    pub amendment: Amendment,
    /// The model with its prior tuned and the accepted effects.
    pub model: GreyBox,
    /// The model with its prior tuned alone.
    pub tuned: GreyBox,
}

impl Amended {
    /// Coefficients that are zero for the sake of an effect that has joined, each with that effect.
    pub fn dropped(&self) -> Vec<(String, &'static str)> {
        dropped(&self.tuned, &self.model)
    }
}

/// Coefficients of `before` that an effect of `after` stands in the place of.
fn dropped(before: &GreyBox, after: &GreyBox) -> Vec<(String, &'static str)> {
    let still = |name: &str| before.replaced(name).is_none();
    let named = before.coefficients().iter().filter(|c| still(&c.name));
    named.filter_map(|c| Some((c.name.clone(), after.replaced(&c.name)?))).collect()
}

/// Fits `model` with the effects of `options` to `flights` and judges it on `held_out`; `progress`
/// hears what is being done.
///
/// # Errors
/// An effect cannot join the model, the flights do not allow a fit, or `progress` ended it.
pub fn amend(
    model: &GreyBox,
    flights: &[Reconstruction],
    held_out: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Amended, AmendError> {
    for added in &options.effects {
        joined(&mut model.clone(), added)?;
    }
    let slowest = model.airframe.envelope.flying_from_mps();
    let ready = |all: &[Reconstruction]| {
        all.iter().map(|f| Flight::new(f, slowest)).collect::<Result<Vec<_>, _>>()
    };
    let (train, test) = (ready(flights)?, ready(held_out)?);
    let judge = Judge { test: &test, horizons_s: &options.horizons_s };
    let ask = Ask { options, train: &train, judge: &judge, progress, begun: AtomicUsize::new(0) };
    let given = judge.scores(model);
    let scratch = (options.prior == Prior::Bounds).then(|| parameters::from_scratch(model));
    let model = scratch.as_ref().unwrap_or(model);
    let best = ask.selected(model)?;
    let (tuned, before) = best.tuned.clone();
    let (best, conventions) = match options.conventions {
        true => ask.with_conventions(model, best)?,
        false => (best, Vec::new()),
    };
    let Selection { fit, after, effects, .. } = best;
    let mut notes = fit.notes.clone();
    notes.extend(
        dropped(&tuned.model, &fit.model)
            .iter()
            .map(|(name, by)| format!("{name} is zero: {by} stands in its place.")),
    );
    notes.extend(parameters::taken_over(&fit.model).map(|(of, by)| {
        format!("The shape constants of {of} stay as they were fitted without {by}, which can take up whatever they could.")
    }));
    let held = parameters::held_at_zero(model);
    if !held.is_empty() {
        notes.push(format!(
            "Held at zero, for their file states no standard deviation (sd): {}. --from-scratch frees them.",
            held.join(", ")
        ));
    }
    notes.extend(judge::contradictions(&fit.parameters));
    let mut amendment = Amendment {
        schema: "greylag.amend/1",
        version: env!("CARGO_PKG_VERSION"),
        model: model.name.clone(),
        sentences: Vec::new(),
        effects,
        conventions,
        parameters: fit.parameters.clone(),
        tuned: tuned.parameters.clone(),
        flights: fit.flights.clone(),
        held_out: held_out.iter().map(|f| f.name.clone()).collect(),
        given,
        before,
        after,
        notes,
        settings: Settings {
            lengths_s: FitOptions::default().lengths_s,
            horizons_s: options.horizons_s.clone(),
            judged_at_s: JUDGED_AT_S,
        },
    };
    let rudder = rudder::unmodelled(flights, model).or(rudder::unmodelled(held_out, model));
    amendment.sentences = rudder.map(rudder::warning).into_iter().collect();
    amendment.sentences.extend(story::sentences(&amendment));
    Ok(Amended { amendment, model: fit.model, tuned: tuned.model })
}

/// A model with those of some effects that the flights bear out.
#[derive(Clone)]
struct Selection {
    /// Tuned without any.
    tuned: (Fit, Vec<HorizonScore>),
    fit: Fit,
    after: Vec<HorizonScore>,
    /// The effects that joined, in order.
    accepted: Vec<Added>,
    /// What became of all.
    effects: Vec<AddedEffect>,
}

/// What is asked for, and of which flights.
struct Ask<'a> {
    options: &'a Options,
    train: &'a [Flight],
    judge: &'a Judge<'a>,
    progress: &'a Progress<'a>,
    /// Fits begun, of which the first tunes the prior.
    begun: AtomicUsize,
}

impl Ask<'_> {
    /// The effects that `model` bears out: those that a diagnosis found together, then the others.
    fn selected(&self, model: &GreyBox) -> Result<Selection, AmendError> {
        let tuned = match &self.options.tuned {
            Some(known) => known.clone(),
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

    /// Asks for what `so_far`, a selection of effects of `model`, does not have, one after the other. One that was
    /// refused while something else was missing is asked for again once that has joined.
    fn rest(&self, model: &GreyBox, so_far: Selection) -> Result<Selection, AmendError> {
        let Options { effects, refused, .. } = self.options;
        let mut best = (so_far.fit, so_far.after);
        let mut accepted: Vec<&Added> = so_far.accepted.iter().collect();
        // each with the number of effects beside which it was asked for, 0 for those that have joined
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

    /// Those of the effects that a diagnosis found together, fitted together, less those that the flights refuse
    /// even so, if unseen flights are flown better with them: one of them alone may be lost beside a gross error
    /// that another mends. `None` if there are not two.
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
        // what the model itself can say is not represented twice, which would widen all intervals
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

    /// Tries the other conventions of `model`, whose selection is `best`, one after the other, and what was not
    /// borne out again once another has been taken.
    fn with_conventions(
        &self,
        model: &GreyBox,
        mut best: Selection,
    ) -> Result<(Selection, Vec<Tried>), AmendError> {
        let mut base = model.clone();
        // each with the number of others beside which it was tried
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
                say(self.progress, &doing, self.done()[0])?;
                let tried = self.under(&other, &best)?;
                let closer = tried.as_ref().map_or(f64::NAN, |t| closer(&best.fit, &t.fit));
                let error = [best.error(), tried.as_ref().map_or(f64::NAN, Selection::error)];
                let taken = tried.filter(|t| {
                    let settled = t.fit.unsettled.is_none() || error[1] < SETTLED_OR_NOT * error[0];
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

    /// `other`, a model under another convention, with the effects that joined already; the rest are asked for again
    /// only where that promises something.
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

    /// Fits `model` with `effects`, which begin where `near` has them, if it does.
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
            // a curve's prior is where it begins
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

    /// A fit to the training flights, heard as a part of the whole.
    fn fit(&self, model: &GreyBox, options: &FitOptions) -> Result<Fit, AmendError> {
        let progress = progress::part(self.progress, self.done());
        self.begun.fetch_add(1, Ordering::Relaxed);
        output_error::fit(model, self.train, options, &progress)
    }

    /// Shares of the work that are done before and after the next fit. Some effects are asked for twice, so the
    /// last share is never full.
    fn done(&self) -> [f64; 2] {
        let begun = self.begun.load(Ordering::Relaxed) as f64;
        let planned = 1.0 + self.options.effects.len() as f64;
        [begun, begun + 1.0].map(|fits| (fits / planned).min(0.98))
    }
}

impl Selection {
    /// The error of unseen flights by which it is judged; NaN if no run gets there.
    fn error(&self) -> f64 {
        judge::judged(&self.after).unwrap_or(f64::NAN)
    }
}

/// `model` with an effect more, at its start.
pub(super) fn joined(model: &mut GreyBox, added: &Added) -> Result<(), AmendError> {
    let start = match (&added.start, parameters::describe(&added.id)) {
        (Some(start), _) => start.clone(),
        (None, Some((about, _))) => usual_start(&about),
        (None, None) => Vec::new(),
    };
    Ok(model.join_most(&added.id, &start)?)
}

/// The middle one of the catalogue's starts, else zero or what lies nearest to it within bounds.
fn usual_start(about: &Description) -> Vec<f64> {
    let starts = about.entry.map_or(&[][..], |e| e.starts);
    let nearest = |c: &Coefficient| 0.0_f64.clamp(c.bounds.0, c.bounds.1);
    // the first of a file's is what the file says; of the catalogue's, the middle one is the usual amount
    let own = Kind::from_id(about.id).is_some_and(|kind| kind.written().is_some());
    let listed = starts.get(if own { 0 } else { starts.len() / 2 }).map(|s| s.to_vec());
    listed.unwrap_or_else(|| about.coefficients.iter().map(nearest).collect())
}

/// The first two thirds of a flight to fit to, the last one to judge by.
pub fn split(flight: &Reconstruction) -> [Reconstruction; 2] {
    let total: usize = flight.segments.iter().map(|s| s.instants.len()).sum();
    let mut left = total * 2 / 3;
    let mut parts = [Vec::new(), Vec::new()];
    for Segment { instants } in &flight.segments {
        let (first, last) = instants.split_at(left.min(instants.len()));
        left -= first.len();
        for (part, piece) in parts.iter_mut().zip([first, last]) {
            if !piece.is_empty() {
                part.push(Segment { instants: piece.to_vec() });
            }
        }
    }
    parts.map(|segments| Reconstruction { segments, ..flight.clone() })
}
