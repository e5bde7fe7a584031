//! Forward selection: the effect with the best evidence joins the model, and again, until none passes.

use crate::model::{GreyBox, RUDDER};
use crate::physics::inputs::{Acts, Kind};
use crate::sysid::compare::ChannelId;
use crate::sysid::diagnose::error::DiagnoseError;
use crate::sysid::diagnose::options::Options;
use crate::sysid::diagnose::regression::catalogue::{self, Entry};
use crate::sysid::diagnose::regression::gather::Column;
use crate::sysid::diagnose::regression::rank::Score;
use crate::sysid::diagnose::search::checks;
use crate::sysid::diagnose::search::excitation;
use crate::sysid::diagnose::search::remainder::{Remainder, remainder};
use crate::sysid::diagnose::search::round::{Problem, Round};
use crate::sysid::diagnose::search::settling::{Ranked, SETTLING, ranked, settled};
use crate::sysid::diagnose::search::shape::{Shape, shape};
use crate::sysid::diagnose::search::unexplained::unexplained;
use crate::sysid::progress::{Cancelled, FirstLook, Progress, Stage, said, say};

/// Share of the search that is done once all candidates have been ranked.
const RANKED: f64 = 0.3;
/// Most effects that are asserted together.
const MOST: usize = 6;
/// Least fall of the error on held-out segments.
pub const HELD_OUT: f64 = 0.1;
/// Least share of bootstraps in which the effect, or one of its class, is the best.
pub const SELECTED: f64 = 0.8;
/// Candidates of this part of the best one's order contend with it,
const CONTENDING: f64 = 0.2;
/// if their contribution is this much like its own;
const CONTENDING_LIKENESS: f64 = 0.6;
/// so many at most.
const CONTENDERS: usize = 4;
/// Part of what is to be removed from its channels that an effect may leave there.
const LEFT: f64 = 0.3;
/// The same of what products of the states take beside it: right ones leave less than 0.02, but for
/// `unsteady_lift`, whose formula is not what the simulator has.
const SHAPELESS: f64 = 0.1;
/// Precision of the formula of an effect that is not linear in its constants: whatever takes a smaller part of
/// what such an effect took before may be no more than its error.
const PRECISION: f64 = 2e-3;
/// The same of what second derivatives of the surfaces take beside an effect on the inputs.
const BENT: f64 = 0.02;
/// Least share of a channel's variance that an effect must explain to be material. A delay of 10 ms explains
/// 2e-4 of it.
const MATERIAL: f64 = 1e-4;
/// A channel that is explained but for this share of its variance is adequate: reconstruction and sampling
/// leave as much of exact models.
const ADEQUATE: f64 = 5e-4;
/// Least share of a channel's error beyond noise that an effect must take to be material beside others.
const MATERIAL_BESIDE: f64 = 0.02;
/// A candidate whose contribution is this much like another's can take its place.
const RIVAL: f64 = 0.3;

/// The candidate that a round selected, with its checks.
#[derive(Clone, Debug)]
pub struct Selected {
    /// Its id.
    pub id: &'static str,
    /// Its score in that round.
    pub score: Score,
    /// Threshold of that round.
    pub threshold: f64,
    /// Ids that the data cannot tell from it.
    pub class: Vec<String>,
    /// Share of the error removed from held-out segments.
    pub heldout: f64,
    /// Share of bootstraps.
    pub selected: f64,
    /// First free coefficient flight by flight, with standard deviations.
    pub by_flight: Vec<[f64; 2]>,
    /// Channels, the one with most of it first.
    pub channels: Vec<usize>,
    /// What it took of the squared whitened error, channel by channel.
    pub taken: [f64; 6],
    /// Why it is not asserted; empty if it is.
    pub refused: Vec<String>,
    /// Whether it takes too little of the error to matter, whatever else speaks against it.
    pub slight: bool,
    /// What there is to say of it if it is significant but not material.
    pub trace: Option<String>,
    /// Whether it is a figure of the model's own by another name, so that what is left says nothing of it.
    pub relieves: bool,
    /// Whether it is not linear in its constants.
    pub curved: bool,
    /// What it added to the residual, fitted, flight by flight.
    pub contribution: Vec<Column>,
}

/// How a search ended.
pub struct Found {
    /// The first round: the model tuned, nothing joined.
    pub first: Round,
    /// Share of each channel's variance beyond noise that the first round leaves unexplained.
    pub unexplained: [f64; 6],
    /// What a flexible model could remove of what the first round leaves.
    pub first_remainder: Remainder,
    /// The last round, with every asserted effect in the model; `None` if that is the first one.
    pub last: Option<Round>,
    /// The same of the last round.
    pub remainder: Remainder,
    /// What the model of the last round leaves beyond noise; `None` if that is the first one.
    pub beyond: Option<checks::Beyond>,
    /// What products of the states take of what it leaves; `None` if they cannot be fitted.
    pub shape: Option<Shape>,
    /// Scores of the last round.
    pub scores: Vec<(usize, Score)>,
    /// Best evidence in the null flights of the first round.
    pub nulls: Vec<f64>,
    /// Threshold of the last round.
    pub threshold: f64,
    /// Trials of the last round that lost against the first one once both had settled.
    pub beaten: Vec<usize>,
    /// Trials of the last round that were as good as the first one once both had settled.
    pub level: Vec<usize>,
    /// Asserted effects in the order of selection, then the one refused, if there is one.
    pub selected: Vec<Selected>,
}

impl Found {
    /// The last round.
    pub fn round(&self) -> &Round {
        self.last.as_ref().unwrap_or(&self.first)
    }
}

/// Searches for what `model` lacks.
///
/// # Errors
/// The flights do not hold the model at all, or `progress` ended the search.
pub fn search(
    problem: &Problem,
    model: &GreyBox,
    options: &Options,
    progress: &Progress,
) -> Result<Found, DiagnoseError> {
    let round = |model: GreyBox, entries: &[Entry]| {
        let unusable = || DiagnoseError::Unusable { model: model.name.clone() };
        Round::new(problem, model.clone(), entries).ok_or_else(unusable)
    };
    say(progress, "tuning the model's own coefficients", 0.0)?;
    let tuned = round(model.clone(), &[])?.tuned();
    let mut entries = catalogue::candidates(model, &options.with, &options.without);
    if !excitation::moves_rudder(&problem.flights) {
        entries.retain(|e| e.about.id != RUDDER);
    }
    say(progress, &format!("ranking {} candidate effects", entries.len()), 0.05)?;
    let shape = shape(&round(tuned.clone(), &[])?, options.nulls);
    let Ranked { round: first, scores, nulls, threshold } =
        ranked(problem, round(tuned, &entries)?, options);
    let ranking = first_look(&first, &scores, threshold);
    let doing = "checking the best candidate";
    said(progress(Stage { doing, fraction: RANKED, ranking: &ranking }))?;
    let first_remainder = remainder(&first, options.nulls, options.level);
    let mut found = Found {
        unexplained: unexplained(&first, &first.tuned_residual()),
        remainder: first_remainder.clone(),
        first,
        first_remainder,
        last: None,
        beyond: None,
        shape,
        scores,
        nulls,
        threshold,
        beaten: Vec::new(),
        level: Vec::new(),
        selected: Vec::new(),
    };
    while found.selected.len() < MOST {
        found.beaten.clear();
        found.level.clear();
        run_off(problem, &mut found);
        say(progress, "checking the best candidate", found.fraction())?;
        let Some(winner) = examine(&found, options) else { break };
        let passed = winner.refused.is_empty() || winner.trace.is_some();
        let outcome = match (&winner.trace, passed) {
            (Some(_), _) => "is a trace",
            (None, true) => "joins",
            (None, false) => "is refused",
        };
        say(progress, &format!("{}: {outcome}", winner.id), found.fraction())?;
        found.selected.push(winner);
        if !passed || !found.join(problem, model, &entries, options, progress)? {
            break;
        }
    }
    found.judge_remainder();
    Ok(found)
}

/// The candidates as the first ranking has them.
fn first_look(round: &Round, scores: &[(usize, Score)], threshold: f64) -> Vec<FirstLook> {
    let of = |(trial, score): &(usize, Score)| FirstLook {
        id: round.trials[*trial].id,
        evidence: score.evidence,
        threshold,
    };
    scores.iter().map(of).collect()
}

/// Puts the best of several close contenders first, each joined to the model and settled under one noise, and
/// tells those that lose clearly from those that are as good: a linearisation at the model without them does
/// not tell them apart.
fn run_off(problem: &Problem, found: &mut Found) -> Option<()> {
    let round = found.last.as_ref().unwrap_or(&found.first);
    let (_, best) = found.scores.first()?;
    if best.evidence < found.threshold {
        return None;
    }
    let contend: Vec<usize> = (0..found.scores.len())
        .filter(|k| {
            let (trial, score) = &found.scores[*k];
            score.order > CONTENDING * best.order
                && !round.at_bound(*trial, score)
                && checks::likeness(round, best, score).abs() > CONTENDING_LIKENESS
        })
        .take(CONTENDERS)
        .collect();
    if contend.len() < 2 {
        return None;
    }
    let error = |k: &usize| {
        let (trial, score) = &found.scores[*k];
        let mut model = round.with(score);
        model.join_most(round.trials[*trial].id, &score.values).ok()?;
        Some(settled(problem, round, model, 1 + SETTLING)?.1)
    };
    let errors: Vec<(usize, f64)> =
        contend.iter().map(|k| (*k, error(k).unwrap_or(f64::INFINITY))).collect();
    let (winner, least) = *errors.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let others = errors.iter().filter(|(k, _)| *k != winner);
    let (beaten, level): (Vec<_>, Vec<_>) = others.partition(|(_, e)| *e > least + checks::CLOSE);
    let trials = |of: Vec<&(usize, f64)>| of.iter().map(|(k, _)| found.scores[*k].0).collect();
    let (beaten, level) = (trials(beaten), trials(level));
    let first = found.scores.remove(winner);
    found.scores.insert(0, first);
    (found.beaten, found.level) = (beaten, level);
    Some(())
}

/// The best candidate, if its evidence exceeds the threshold, with all its checks.
fn examine(found: &Found, options: &Options) -> Option<Selected> {
    let round = found.round();
    let (place, score) = found.scores.first()?;
    if score.evidence.partial_cmp(&found.threshold)? != std::cmp::Ordering::Greater {
        return None;
    }
    let trial = &round.trials[*place];
    let mut refused = Vec::new();
    if round.at_bound(*place, score) {
        refused.push("a constant lies at the end of what is physically possible".into());
    }
    let mut class = checks::class(round, &found.scores, 0);
    class.retain(|k| !found.beaten.contains(&found.scores[*k].0));
    // settled, they are as good: how they did where the model was linearised without them says no more
    let level = (1..found.scores.len()).filter(|k| found.level.contains(&found.scores[*k].0));
    let level: Vec<usize> = level.filter(|k| !class.contains(k)).collect();
    class.extend(level);
    let members: Vec<usize> =
        std::iter::once(*place).chain(class.iter().map(|k| found.scores[*k].0)).collect();
    let heldout = checks::heldout_reduction(round, trial, score);
    let relieves = checks::relieves(round, score);
    let slight = (heldout < HELD_OUT || heldout.is_nan()) && !relieves;
    if slight {
        refused.push(format!(
            "it takes {:.0} % of the error on held-out segments, under {:.0} %",
            100.0 * heldout,
            100.0 * HELD_OUT
        ));
    }
    // what explains something else would be selected besides, not in its place
    let rival = |(t, other): &&(usize, Score)| {
        !found.beaten.contains(t) && checks::likeness(round, score, other).abs() > RIVAL
    };
    let open: Vec<usize> = found.scores.iter().filter(rival).map(|(t, _)| *t).collect();
    let selected = checks::selected(round, &open, &members, options.bootstraps);
    if selected < SELECTED && options.bootstraps > 0 {
        refused.push(format!(
            "it is the best in {:.0} % of the block bootstraps, under {:.0} %",
            100.0 * selected,
            100.0 * SELECTED
        ));
    }
    // what relieves the prior takes its strain, which no formula's error is
    let earlier = found.selected.iter().find(|s| s.curved && hides(s, score));
    if let Some(earlier) = earlier.filter(|_| !relieves) {
        refused.push(format!(
            "it takes less than {:.1} % of what {} took, whose formula is no more precise",
            100.0 * PRECISION,
            earlier.id
        ));
    }
    let by_flight = checks::by_flight(round, trial, score);
    let first = trial.points[score.point].free[0].0;
    if checks::contradict(score.values[first], &by_flight) {
        refused.push("the flights contradict one another about its amount".into());
    }
    let contribution = round.contribution(score);
    let trace = match refused.is_empty() && !relieves {
        true => immaterial(found, round, score),
        false => None,
    };
    refused.extend(trace.clone());
    Some(Selected {
        id: trial.id,
        score: score.clone(),
        threshold: found.threshold,
        class: class.iter().map(|k| round.trials[found.scores[*k].0].id.to_owned()).collect(),
        heldout,
        selected,
        by_flight,
        channels: round.channels_of(score),
        taken: round.taken_by(score),
        refused,
        slight,
        trace,
        relieves,
        curved: trial.points[score.point].contribution.is_some(),
        contribution,
    })
}

/// Says so if a significant effect does not matter: in no channel does it explain [`MATERIAL`] of the variance
/// and [`MATERIAL_BESIDE`] of what the tuned model left beyond noise.
fn immaterial(found: &Found, round: &Round, score: &Score) -> Option<String> {
    let taken = round.taken_by(score);
    let of_channel = |c: usize| {
        let only = std::array::from_fn(|k| k == c);
        let share = (taken[c] / checks::excess(&found.first, &only).max(taken[c])).max(0.0);
        let share = if share.is_finite() { share } else { 0.0 };
        [share, share * found.unexplained[c]]
    };
    let shares: Vec<[f64; 2]> = (0..6).map(of_channel).collect();
    let matters = |[of_error, of_variance]: &[f64; 2]| {
        *of_error >= MATERIAL_BESIDE && *of_variance >= MATERIAL
    };
    let most = |k: usize| 100.0 * shares.iter().map(|s| s[k]).fold(0.0, f64::max);
    (!shares.iter().any(matters)).then(|| {
        format!(
            "trace: real or of the sampling, it explains at most {:.2} % of a channel's variance and {:.1} % of \
             a channel's error, under {:.2} % and {:.0} %",
            most(1),
            most(0),
            100.0 * MATERIAL,
            100.0 * MATERIAL_BESIDE
        )
    })
}

/// Whether `score` may be an error of what has been selected before.
fn hides(earlier: &Selected, score: &Score) -> bool {
    score.fall < PRECISION * earlier.score.fall
}

/// `current` without the effect `id`, which `given` does not have either.
fn without(given: &GreyBox, current: &GreyBox, id: &str) -> GreyBox {
    let mut model = given.clone();
    let joined: Vec<&'static str> =
        current.effects().map(|e| e.id).filter(|e| *e != id && !given.has(e)).collect();
    let own = |effect: &str| -> Vec<f64> {
        let prefix = format!("{effect}.");
        let of = current.coefficients().iter().filter(|c| c.name.starts_with(&prefix));
        of.map(|c| c.value).collect()
    };
    for effect in joined {
        // what it had is possible again
        let _ = model.join(effect, &own(effect));
    }
    for c in current.coefficients().iter().filter(|c| {
        // what it replaced is there again
        current.replaced(&c.name) != Some(id)
    }) {
        model.set_coefficient(&c.name, c.value);
    }
    model
}

impl Found {
    /// Joins the effect selected last to the model and ranks what is left.
    /// An earlier one that is nothing beside it goes.
    fn join(
        &mut self,
        problem: &Problem,
        given: &GreyBox,
        entries: &[Entry],
        options: &Options,
        progress: &Progress,
    ) -> Result<bool, Cancelled> {
        let Some(winner) = self.selected.last().cloned() else { return Ok(false) };
        let mut model = self.round().with(&winner.score);
        if model.join_most(winner.id, &winner.score.values).is_err() {
            return Ok(false);
        }
        for _ in 0..SETTLING {
            say(progress, &format!("settling the model with {}", winner.id), self.fraction())?;
            let Some(round) = Round::new(problem, model.clone(), &[]) else { return Ok(false) };
            model = round.tuned();
            let newest = winner.id;
            let idle = self.selected.iter().find(|s| {
                s.id != newest && round.amount(s.id).is_some_and(|wald| wald < self.threshold)
            });
            if let Some(idle) = idle.map(|s| s.id) {
                model = without(given, &model, idle);
                self.selected.retain(|s| s.id != idle);
                break;
            }
        }
        let Some(settled) = Round::new(problem, model.clone(), &[]) else { return Ok(false) };
        self.beyond = Some(checks::Beyond::of(&settled));
        self.shape = shape(&settled, options.nulls);
        let open: Vec<Entry> = entries.iter().filter(|e| !model.has(e.about.id)).copied().collect();
        say(progress, &format!("ranking {} candidate effects again", open.len()), self.fraction())?;
        let Some(round) = Round::new(problem, model, &open) else { return Ok(false) };
        let Ranked { round, scores, threshold, .. } = ranked(problem, round, options);
        (self.scores, self.threshold) = (scores, threshold);
        self.remainder = remainder(&round, options.nulls, options.level);
        self.last = Some(round);
        Ok(true)
    }

    /// Share of the search that is done; how many effects will be selected is not known.
    fn fraction(&self) -> f64 {
        let left = 0.5_f64.powi(self.selected.len() as i32);
        RANKED + (0.9 - RANKED) * (1.0 - left)
    }

    /// Refuses effects that leave in their own channels much of what there is to remove: of what they take
    /// themselves and what a flexible model could remove besides, or of what is more than noise.
    fn judge_remainder(&mut self) {
        let (before, after) = (&self.first_remainder, &self.remainder);
        let real = |s: &&Selected| s.refused.is_empty() && !s.relieves;
        let taken: Vec<(&'static str, [f64; 6])> =
            self.selected.iter().filter(real).map(|s| (s.id, s.taken)).collect();
        let assertable = self.selected.iter_mut().filter(|s| s.refused.is_empty() && !s.relieves);
        for effect in assertable {
            let own = |of: &[f64; 6]| effect.channels.iter().map(|c| of[*c]).sum::<f64>();
            let significant =
                effect.channels.iter().any(|c| after.removable[*c] > after.threshold[*c]);
            let least = own(&after.removable);
            let share = least / own(&before.removable).max(least + effect.score.fall).max(1.0);
            if significant && share > LEFT {
                effect.refused.push(format!(
                    "with it, a flexible model could still remove {:.0} % of what it could without",
                    100.0 * share
                ));
            }
            let beyond = self.beyond.as_ref();
            let left = beyond.and_then(|b| b.share(&effect.channels, effect.score.fall));
            if let Some(share) = left.filter(|share| *share > LEFT) {
                effect.refused.push(format!(
                    "with it, {:.0} % of what its channels have beyond noise is still there",
                    100.0 * share
                ));
            }
            let Some(shape) = &self.shape else { continue };
            // several effects of a channel leave what they leave together
            let others = taken.iter().filter(|(id, _)| *id != effect.id);
            let others: f64 =
                others.map(|(_, of)| effect.channels.iter().map(|c| of[*c]).sum::<f64>()).sum();
            let beside = shape.beside(&effect.channels, effect.score.fall + others.max(0.0));
            if let Some((share, term)) = beside.filter(|(share, _)| *share > SHAPELESS) {
                effect.refused.push(format!(
                    "with it, products of the states, {term} above all, still explain {:.0} % of what is \
                     missing: its formula has another shape",
                    100.0 * share
                ));
            }
            let bends = shape.bends_beside(effect.score.fall);
            let on_surfaces =
                Kind::from_id(effect.id).is_some_and(|k| k.acts() == Acts::OnSurfaces);
            if on_surfaces && bends > BENT {
                effect.refused.push(format!(
                    "lack of fit: with it, second derivatives of the surfaces still explain {:.1} % of what is \
                     missing, so what acts on them takes another course in time",
                    100.0 * bends
                ));
            }
        }
        self.refuse_companions();
    }

    /// Refuses every effect that acts in one of `channels`, for `reason`.
    pub fn refuse_in(&mut self, channels: &[ChannelId], except: &str, reason: &str) {
        let touched = |c: &usize| channels.contains(&ChannelId::ALL[*c]);
        let spared = |s: &&mut Selected| s.id != except && s.channels.iter().any(touched);
        for effect in self.selected.iter_mut().filter(spared) {
            effect.refused.push(reason.to_owned());
        }
        self.refuse_companions();
    }

    /// Refuses what was found beside an effect that is refused: it is no more sure than that.
    fn refuse_companions(&mut self) {
        let refused = |s: &Selected| !s.refused.is_empty() && s.trace.is_none();
        let Some(first) = self.selected.iter().position(refused) else { return };
        let (refused, later) = self.selected.split_at_mut(first + 1);
        for effect in later.iter_mut().filter(|s| s.refused.is_empty()) {
            effect
                .refused
                .push(format!("it was found beside {}, which is refused", refused[first].id));
        }
    }

    /// Whether what is left goes with products of states more than chance does, in a channel where it matters.
    pub fn has_shape(&self) -> bool {
        let left = self.left();
        let in_channel = |shape: &Shape, c: usize| left[c] >= ADEQUATE && shape.term(c).is_some();
        self.shape.as_ref().is_some_and(|shape| (0..6).any(|c| in_channel(shape, c)))
    }

    /// Share of each channel's variance beyond noise that the last round leaves unexplained.
    pub fn left(&self) -> [f64; 6] {
        unexplained(&self.first, &self.round().tuned_residual())
    }

    /// Whether the last round leaves a channel that is not adequate.
    pub fn leaves_something(&self) -> bool {
        self.left().iter().any(|share| *share >= ADEQUATE)
    }

    /// Share of the squared error beyond noise under the tuned model that a flexible model could still
    /// remove.
    pub fn learnable(&self) -> f64 {
        let excess = checks::excess(&self.first, &[true; 6]);
        self.remainder.total / excess.max(self.remainder.total).max(1.0)
    }
}
