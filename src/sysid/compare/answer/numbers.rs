//! Numbers of an answer, which is the summary of a comparison: errors, their changes, coefficients of the added effects (physical
//! contributions to forces and moments).
//!
//! Errors are those of free runs (open-loop simulations from measured states). The models form a sequence: the given model,
//! then models derived from it or compared with it.

use serde::Serialize;

use super::{ANSWER_S, Acting, Method, Seen, Stage, Subject};
use crate::compare::result::{HorizonScore, StateScore};
use greylag_physics::Channel;
use greylag_physics::catalogue::describe;

/// Magnitude of a change of the error, %, below which the error counts as unchanged.
pub(super) const NOTICED: f64 = 0.05;

/// The error of a state on which an added effect acts falls notably if it falls by at least this fraction.
const NOTABLY: f64 = 0.3;
/// Smallest notable fall of the error relative to x_c, as a fraction of the largest fall of any state.
const BESIDE: f64 = 0.1;

/// Derivation of a model from the model before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// The given model, the first of the sequence.
    Given,
    /// The coefficients of the model before it were fitted.
    Tuned,
    /// Effects were added, and all coefficients refitted.
    Effects,
    /// A different model, compared with the first one.
    Other,
}

/// A model in the sequence, with its error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Step {
    /// Derivation from the model before it.
    pub way: Way,
    /// Name of the model.
    pub model: String,
    /// Free-run error at the horizon of the answer: NRMSE, the root mean square over runs and states of error / x_c. x_c is the
    /// characteristic scale of the state.
    pub error: f64,
    /// Change of `error` relative to the step before, %; relative to the first step for `Way::Other`. `None` for the first
    /// step.
    pub change_percent: Option<f64>,
}

/// An effect with its most significant coefficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Decisive {
    /// Identifier of the effect.
    pub id: String,
    /// Description of the effect, in words.
    pub description: String,
    /// Name of the coefficient.
    pub coefficient: String,
    /// Estimate of the coefficient, in `unit`.
    pub value: f64,
    /// 95 % interval of `value`.
    pub ci95: [f64; 2],
    /// Unit of `value`; may be empty.
    pub unit: String,
    /// Identifiers of effects that the flights cannot distinguish from this effect.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub alike: Vec<String>,
}

impl Decisive {
    /// Significance of a coefficient: magnitude of `value` divided by the width of its 95 % interval. 0 if the quotient is not
    /// finite.
    pub fn clearness(value: f64, ci95: [f64; 2]) -> f64 {
        let clear = value.abs() / (ci95[1] - ci95[0]);
        if clear.is_finite() { clear } else { 0.0 }
    }
}

/// The state whose root mean square error, relative to its scale x_c, decreases most. A state on which the added effects act
/// directly is preferred if its error falls notably.
///
/// The last model is compared with the model before it if effects were added to it. Otherwise it is compared with the first
/// model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InUse {
    /// State with its unit, as in `State::NAMES`.
    pub state: &'static str,
    /// Root mean square error of the earlier model, in the unit of `state`.
    pub before: f64,
    /// Root mean square error of the last model, in the unit of `state`.
    pub after: f64,
}

/// The state with the largest remaining error relative to its scale x_c.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Left {
    /// State with its unit, as in `State::NAMES`.
    pub state: &'static str,
    /// Root mean square error, in the unit of `state`.
    pub rmse: f64,
}

/// A baseline forecast that uses no aerodynamics, for example the held initial state.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Baseline {
    /// Name of the forecast.
    pub name: String,
    /// NRMSE of the forecast at the horizon of the answer.
    pub error: f64,
}

/// All numbers of an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Numbers {
    /// Horizon of the free runs, s; NaN (null) if none is reached.
    pub horizon_s: f64,
    /// Names of the flights.
    pub flights: Vec<String>,
    /// Number of these flights to which a model was fitted; `None` (null) if this is unknown.
    pub fitted_flights: Option<usize>,
    /// Whether the flights are the last third of a flight to whose first two thirds the model was fitted.
    pub last_third: bool,
    /// Whether the fit had no prior but the bounds, so that it cannot be repeated from scratch.
    #[serde(skip)]
    pub from_scratch: bool,
    /// The models, from the given model to the last model; empty if no horizon is reached.
    pub steps: Vec<Step>,
    /// Change of the error from the first to the last model, %; NaN (null) for a single model.
    pub change_percent: f64,
    /// The best baseline forecast; `None` if the answer has none, or if no run of the forecast reaches the horizon.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub baseline: Option<Baseline>,
    /// Change from the error of this forecast to that of the last model if the last model was fitted, %; `None` if it was not, or
    /// without a forecast.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beside_baseline_percent: Option<f64>,
    /// Effects that the last model has and the first model lacks.
    pub effects: Vec<Decisive>,
    /// The one or two channels in which these effects act, the largest reduction first; empty if the shares are unknown.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub acts: Vec<Acting>,
    /// Method by which the coefficients of the models of `acts` were fitted; `None` if `acts` is empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<Method>,
    /// The state whose prediction shows the improvement best; `None` if no prediction improves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_use: Option<InUse>,
    /// The state with the largest remaining error, under the first model if tuning it is in vain. `None` if no horizon is
    /// reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left: Option<Left>,
}

impl Numbers {
    pub(super) fn of(subject: &Subject) -> Numbers {
        let stages = &subject.stages;
        let horizon_s = horizon(stages).unwrap_or(f64::NAN);
        let at: Vec<&HorizonScore> =
            stages.iter().filter_map(|s| score(s.scores, horizon_s)).collect();
        let steps = steps(stages, &at);
        let kept = if in_vain(&steps) { at.first() } else { at.last() };
        let change_percent = match &steps[..] {
            [first, .., last] => change(first.error, last.error),
            _ => f64::NAN,
        };
        let baseline = subject.baseline.and_then(|(name, scores)| {
            Some(Baseline { name: name.into(), error: score(scores, horizon_s)?.rmse_scaled })
        });
        let fitted = steps.last().filter(|s| matches!(s.way, Way::Tuned | Way::Effects));
        let beside = |(b, last): (&Baseline, &Step)| change(b.error, last.error);
        let before = match (&at[..], stages.last().map(|s| s.way)) {
            ([.., before, _], Some(Way::Effects)) => Some(before),
            ([first, .., _], Some(_)) => Some(first),
            _ => None,
        };
        Numbers {
            horizon_s,
            flights: subject.flights.clone(),
            fitted_flights: match subject.seen {
                Seen::Unknown => None,
                Seen::Of(count) => Some(count),
                Seen::LastThird => Some(0),
            },
            last_third: subject.seen == Seen::LastThird,
            from_scratch: false,
            change_percent,
            beside_baseline_percent: baseline.as_ref().zip(fitted).map(beside),
            baseline,
            effects: subject.effects.clone(),
            acts: Vec::new(),
            method: None,
            in_use: before
                .zip(at.last())
                .and_then(|(before, after)| in_use(before, after, &subject.effects)),
            left: kept.and_then(|kept| left(kept)),
            steps,
        }
    }

    /// Whether a model was fitted to all of the flights.
    pub(super) fn fitted(&self) -> bool {
        self.fitted_flights.is_some_and(|fitted| fitted >= self.flights.len())
    }

    /// Whether the only change of the model was to tune it, and its error rises.
    pub(super) fn in_vain(&self) -> bool {
        in_vain(&self.steps)
    }

    /// The baseline forecast, if the given model errs more and the later models are derived from it by a fit.
    pub(super) fn better_baseline(&self) -> Option<&Baseline> {
        let baseline = self.baseline.as_ref()?;
        let [given, tuned, ..] = &self.steps[..] else { return None };
        (tuned.way == Way::Tuned && given.error > baseline.error).then_some(baseline)
    }

    /// Whether that baseline forecast errs less than every model, so that neither the fit nor added effects help.
    pub(super) fn all_behind(&self) -> bool {
        let behind = |b: &Baseline| self.steps.iter().all(|step| step.error > b.error);
        self.better_baseline().is_some_and(behind)
    }
}

fn in_vain(steps: &[Step]) -> bool {
    let rises = |tuned: &Step| tuned.change_percent.is_some_and(|p| p >= NOTICED);
    matches!(steps, [_, tuned] if tuned.way == Way::Tuned && rises(tuned))
}

/// The longest horizon up to [`ANSWER_S`], s, that runs of every model reach. If there is none, the shortest horizon that runs
/// of every model reach.
fn horizon(stages: &[Stage]) -> Option<f64> {
    let first = stages.first()?;
    let reached = |s: &&HorizonScore| {
        let there = |stage: &Stage| score(stage.scores, s.horizon_s).is_some();
        stages.iter().all(there)
    };
    let all: Vec<f64> = first.scores.iter().filter(reached).map(|s| s.horizon_s).collect();
    let below = all.iter().copied().filter(|h| *h <= ANSWER_S + 1e-9).max_by(f64::total_cmp);
    below.or_else(|| all.into_iter().min_by(f64::total_cmp))
}

/// The score at `horizon_s` (s); `None` if no run reaches this horizon or the error is not finite.
fn score(scores: &[HorizonScore], horizon_s: f64) -> Option<&HorizonScore> {
    scores.iter().find(|s| s.horizon_s == horizon_s && s.runs > 0 && s.rmse_scaled.is_finite())
}

fn steps(stages: &[Stage], at: &[&HorizonScore]) -> Vec<Step> {
    if at.len() < stages.len() {
        return Vec::new();
    }
    let step = |k: usize| {
        let Stage { way, model, .. } = stages[k];
        let before = if way == Way::Other { 0 } else { k.saturating_sub(1) };
        Step {
            way,
            model: model.into(),
            error: at[k].rmse_scaled,
            change_percent: (k > 0).then(|| change(at[before].rmse_scaled, at[k].rmse_scaled)),
        }
    };
    (0..stages.len()).map(step).collect()
}

/// Change from `from` to `to`, %.
fn change(from: f64, to: f64) -> f64 {
    100.0 * (to / from - 1.0)
}

fn in_use(before: &HorizonScore, after: &HorizonScore, effects: &[Decisive]) -> Option<InUse> {
    let gain = |(a, b): (&StateScore, &StateScore)| {
        let gain = a.rmse_scaled - b.rmse_scaled;
        (gain > 0.0).then_some((gain, InUse { state: a.state, before: a.rmse, after: b.rmse }))
    };
    let gains: Vec<(f64, InUse)> =
        before.states.iter().zip(&after.states).filter_map(gain).collect();
    let own = states_of(effects);
    let largest = gains.iter().map(|(gain, _)| *gain).fold(0.0, f64::max);
    let notable = |(gain, used): &(f64, InUse)| {
        *gain >= BESIDE * largest && used.after <= (1.0 - NOTABLY) * used.before
    };
    let direct = |of: &(f64, InUse)| own.contains(&of.1.state) && notable(of);
    let most = |a: &&(f64, InUse), b: &&(f64, InUse)| a.0.total_cmp(&b.0);
    let found = gains.iter().filter(|of| direct(of)).max_by(most);
    found.or_else(|| gains.iter().max_by(most)).map(|(_, used)| used.clone())
}

/// States that the channels of `effects` change directly, according to the catalogue. Empty for effects on the deflections.
fn states_of(effects: &[Decisive]) -> Vec<&'static str> {
    let entries = effects.iter().filter_map(|e| describe(&e.id)?.entry);
    entries.flat_map(|entry| entry.channels.iter().flat_map(changed_by).copied()).collect()
}

/// States that a force or moment in `channel` changes directly.
fn changed_by(channel: &Channel) -> &'static [&'static str] {
    match channel {
        Channel::Drag | Channel::BodyX => &["airspeed_mps"],
        Channel::Lift => &["alpha_rad"],
        Channel::Side => &["beta_rad"],
        Channel::Roll => &["roll_rad"],
        Channel::Pitch => &["pitch_rad", "alpha_rad"],
        Channel::Yaw => &["beta_rad", "r_radps"],
    }
}

fn left(last: &HorizonScore) -> Option<Left> {
    let finite = last.states.iter().filter(|s| s.rmse_scaled.is_finite());
    let worst = finite.max_by(|a, b| a.rmse_scaled.total_cmp(&b.rmse_scaled))?;
    Some(Left { state: worst.state, rmse: worst.rmse })
}
