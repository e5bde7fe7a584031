//! The numbers of an answer.

use serde::Serialize;

use super::{ANSWER_S, Seen, Stage, Subject};
use crate::compare::result::{HorizonScore, StateScore};

/// How a model came from the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// It is the first one.
    Given,
    /// Its own coefficients were fitted.
    Tuned,
    /// Effects were added, and all fitted again.
    Effects,
    /// It is another model.
    Other,
}

/// A model on the way.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Step {
    /// How it came from the one before.
    pub way: Way,
    /// Its name.
    pub model: String,
    /// Free-run error at the horizon: NRMSE, the root mean square over the eight states, each over its scale x_c.
    pub error: f64,
    /// Change from the step before, %; of another model from the first. `None` of the first.
    pub change_percent: Option<f64>,
}

/// The clearest coefficient of an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Decisive {
    /// The effect's id.
    pub id: String,
    /// What it is, in words.
    pub description: String,
    /// The coefficient.
    pub coefficient: String,
    /// Its value.
    pub value: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
    /// Its unit; may be empty.
    pub unit: String,
    /// Ids that the flights cannot tell from the effect.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub alike: Vec<String>,
}

impl Decisive {
    /// How clearly it differs from zero: its value over its interval's width.
    pub fn clearness(value: f64, ci95: [f64; 2]) -> f64 {
        let clear = value.abs() / (ci95[1] - ci95[0]);
        if clear.is_finite() { clear } else { 0.0 }
    }
}

/// What the last step changes in use: the state whose prediction gains most for its scale.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InUse {
    /// The state, with its unit, as in `State::NAMES`.
    pub state: &'static str,
    /// Its root mean square error before the step, in that unit.
    pub before: f64,
    /// After it.
    pub after: f64,
}

/// The state whose prediction is off most for its scale.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Left {
    /// The state, with its unit.
    pub state: &'static str,
    /// Its root mean square error, in that unit.
    pub rmse: f64,
}

/// A forecast without aerodynamics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Baseline {
    /// What it does.
    pub name: String,
    /// Its error at the horizon.
    pub error: f64,
}

/// Every number that stands in an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Numbers {
    /// Horizon of the free runs, s; NaN (null) if none is reached.
    pub horizon_s: f64,
    /// The flights.
    pub flights: Vec<String>,
    /// How many of them a fit has seen; `None` (null) if that is not known.
    pub fitted_flights: Option<usize>,
    /// Whether they are the last third of a flight whose rest was fitted.
    pub last_third: bool,
    /// The models on the way.
    pub steps: Vec<Step>,
    /// Change of the error from the first to the last, %; NaN (null) if there is one only.
    pub change_percent: f64,
    /// The best forecast without aerodynamics, where models stand beside some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub baseline: Option<Baseline>,
    /// What the last model has more than the first.
    pub effects: Vec<Decisive>,
    /// What that changes in use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_use: Option<InUse>,
    /// What is left.
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
        let change_percent = match &steps[..] {
            [first, .., last] => change(first.error, last.error),
            _ => f64::NAN,
        };
        let baseline = subject.baseline.and_then(|(name, scores)| {
            Some(Baseline { name: name.into(), error: score(scores, horizon_s)?.rmse_scaled })
        });
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
            change_percent,
            baseline,
            effects: subject.effects.clone(),
            in_use: before.zip(at.last()).and_then(|(before, after)| in_use(before, after)),
            left: at.last().and_then(|last| left(last)),
            steps,
        }
    }
}

/// The longest horizon up to [`ANSWER_S`] that runs of every model reach, else the shortest that they reach.
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

/// The score at a horizon that runs reach.
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

fn in_use(before: &HorizonScore, after: &HorizonScore) -> Option<InUse> {
    let gain = |(a, b): (&StateScore, &StateScore)| {
        let gain = a.rmse_scaled - b.rmse_scaled;
        (gain > 0.0).then_some((gain, InUse { state: a.state, before: a.rmse, after: b.rmse }))
    };
    let gains = before.states.iter().zip(&after.states).filter_map(gain);
    gains.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, found)| found)
}

fn left(last: &HorizonScore) -> Option<Left> {
    let finite = last.states.iter().filter(|s| s.rmse_scaled.is_finite());
    let worst = finite.max_by(|a, b| a.rmse_scaled.total_cmp(&b.rmse_scaled))?;
    Some(Left { state: worst.state, rmse: worst.rmse })
}
