//! Size and shape of the search.

use std::str::FromStr;

use super::rollout::{HORIZON, WIDTH};

/// How the candidates of an iteration make the next distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update {
    /// Mean and deviation of the K best: the cross-entropy method.
    Elites(usize),
    /// Mean and deviation of all, weighted with exp(return / λ): MPPI (Williams et al., 2017), λ in units
    /// of the return.
    Weighted(f64),
}

/// Where the first iteration's mean lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// In the middle of every action's range.
    Neutral,
    /// On the policy's own plan.
    Policy,
    /// On the last tick's plan, a tick later (iCEM, Pinneri et al., CoRL 2020).
    Last,
}

/// What values the end of a candidate, where critics are asked at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// The critics, each candidate.
    Critics,
    /// A plane through the critics' values of the tick's first 128 candidates; the best 64 of the last
    /// iteration are valued by the critics again. Without a base only.
    Fitted,
}

/// Which vector instructions fly the candidates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// The widest that the processor has.
    Widest,
    /// What every processor of the target has. A multiply-add may be rounded otherwise, so a flight repeats
    /// to the bit under one of the two, not across them.
    Portable,
}

/// Size of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Candidates per iteration N, a multiple of 16.
    pub population: usize,
    /// What becomes of them.
    pub update: Update,
    /// Iterations I.
    pub iterations: usize,
    /// Where the search starts.
    pub start: Start,
    /// Standard deviation of the first iteration, in units of the action.
    pub spread: f64,
    /// Correlation of a candidate's noise from one step to the next, 0..1 (iCEM's coloured noise, of first
    /// order).
    pub persistence: f64,
    /// Best candidates that stay in the next iteration (iCEM), fewer than 16.
    pub kept: usize,
    /// Candidates of the first iteration that the policy proposes, a multiple of 16; the first of them
    /// without noise.
    pub proposals: usize,
    /// Standard deviation of the noise on the others, and where it is cut off.
    pub noise: [f64; 2],
    /// Weight α of the critics' value of the end, eq. (26).
    pub alpha: Option<f64>,
    /// Who says that value.
    pub value: Value,
    /// Steps in all that a plan is flown in the model: the base flies from the sixth on, without a base the
    /// policy; without either there are five.
    pub steps: usize,
    /// Ticks that a plan is flown before the next one is made, up to 5; with a base every tick is planned.
    pub chunk: usize,
    /// Whether a tick plans for the next one, from where the model will be then (RT-HCP's delay of one step),
    /// so that planning may take the whole period. Without a base only, and a plan is then flown for one tick.
    pub delay: bool,
    /// What a plan must be worth beside the base's to be flown, in units of the return.
    pub margin: f64,
    /// Whether iLQR's plan is among the candidates; it needs a base.
    pub ilqr: bool,
    /// Time constant (s) with which what the model leaves unexplained is estimated; `None`: it is not.
    pub disturbance: Option<f64>,
    /// Largest part of the motion that the model's one-step predictions may have missed in the last half second
    /// for plans to be made; above it the base flies alone. It needs a base and the estimate of the disturbance.
    pub trust: Option<f64>,
    /// What flies the candidates.
    pub instructions: Instructions,
    /// Cores that fly them, one or two; the commands are the same.
    pub cores: usize,
}

impl Settings {
    /// CEM-MPC alone. H = 5 is the paper's; N, K, I are not given there: 1024 rollouts a step in all.
    pub const PAPER: Settings = Settings {
        population: 256,
        update: Update::Elites(16),
        iterations: 4,
        start: Start::Neutral,
        spread: 1.0,
        persistence: 0.0,
        kept: 0,
        proposals: 0,
        noise: [0.2, 0.5],
        alpha: None,
        value: Value::Critics,
        steps: HORIZON,
        chunk: 1,
        delay: false,
        margin: 0.0,
        ilqr: false,
        disturbance: None,
        trust: None,
        instructions: Instructions::Widest,
        cores: 1,
    };
    /// CEM + π.
    pub const POLICY: Settings = Settings { proposals: 32, ..Settings::PAPER };
    /// CEM + Q.
    pub const CRITICS: Settings = Settings { alpha: Some(1.0), ..Settings::PAPER };
    /// The hybrid controller. It searches close to the policy's plan: critics are right to a few per cent of a
    /// return, and the wider the search, the more of what it finds is their error (at a spread of 1 about the
    /// middle of the range, with proposals spread by 0.2, it is worse than the policy it plans with).
    pub const HYBRID: Settings = Settings {
        alpha: Some(1.0),
        start: Start::Policy,
        spread: 0.02,
        noise: [0.02, 0.06],
        ..Settings::POLICY
    };
    /// The hybrid controller whose policy flies on behind each plan up to step 40 in the model, before the critics
    /// value the state. It is as good without critics.
    pub const OVER_POLICY: Settings = Settings {
        population: 64,
        update: Update::Elites(8),
        iterations: 3,
        proposals: 16,
        steps: 40,
        ..Settings::HYBRID
    };
    /// MPPI over the same rollouts.
    pub const MPPI: Settings = Settings { update: Update::Weighted(0.01), ..Settings::PAPER };
    /// The hybrid controller over an LQI, which flies on behind each plan: that is what the end is
    /// worth, in place of critics. Offset-free.
    ///
    /// The margin is 0.12° of attitude error over all steps: less is the search's noise, and a plan that is
    /// flown for it takes the LQI's integrals out of the loop (at 0.002 hard targets settle at 0.04°, at
    /// 0.05 at 0.001°).
    pub const OVER_LQI: Settings = Settings {
        population: 128,
        update: Update::Elites(12),
        iterations: 3,
        spread: 0.3,
        proposals: 16,
        noise: [0.1, 0.3],
        steps: 80,
        margin: 5e-2,
        disturbance: Some(0.3),
        trust: Some(0.5),
        ..Settings::PAPER
    };

    /// Whether the search needs a policy.
    pub(crate) fn needs_policy(&self) -> bool {
        self.proposals > 0 || self.alpha.is_some() || self.start == Start::Policy
    }

    /// These settings with `changes`, the later ones over the earlier.
    pub fn with(self, changes: &[Change]) -> Settings {
        changes.iter().fold(self, |settings, change| change.made(settings))
    }
}

/// One setting in other than its usual size, as `KEY=VALUE`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// [`Settings::population`].
    Population(usize),
    /// [`Update::Elites`].
    Elites(usize),
    /// [`Update::Weighted`].
    Temperature(f64),
    /// [`Settings::iterations`].
    Iterations(usize),
    /// [`Settings::start`].
    Start(Start),
    /// [`Settings::spread`].
    Spread(f64),
    /// [`Settings::persistence`].
    Persistence(f64),
    /// [`Settings::kept`].
    Kept(usize),
    /// [`Settings::proposals`].
    Proposals(usize),
    /// [`Settings::noise`], the deviation; it is cut off at three of them.
    Noise(f64),
    /// [`Settings::alpha`].
    Alpha(Option<f64>),
    /// [`Settings::value`].
    Value(Value),
    /// [`Settings::steps`].
    Steps(usize),
    /// [`Settings::chunk`].
    Chunk(usize),
    /// [`Settings::delay`].
    Delay(bool),
    /// [`Settings::margin`].
    Margin(f64),
    /// [`Settings::ilqr`].
    Ilqr(bool),
    /// [`Settings::disturbance`].
    Disturbance(Option<f64>),
    /// [`Settings::trust`].
    Trust(Option<f64>),
    /// [`Settings::instructions`].
    Instructions(Instructions),
    /// [`Settings::cores`].
    Cores(usize),
}

impl Change {
    fn made(self, s: Settings) -> Settings {
        match self {
            Change::Population(population) => Settings { population, ..s },
            Change::Elites(count) => Settings { update: Update::Elites(count), ..s },
            Change::Temperature(scale) => Settings { update: Update::Weighted(scale), ..s },
            Change::Iterations(iterations) => Settings { iterations, ..s },
            Change::Start(start) => Settings { start, ..s },
            Change::Spread(spread) => Settings { spread, ..s },
            Change::Persistence(persistence) => Settings { persistence, ..s },
            Change::Kept(kept) => Settings { kept, ..s },
            Change::Proposals(proposals) => Settings { proposals, ..s },
            Change::Noise(deviation) => Settings { noise: [deviation, 3.0 * deviation], ..s },
            Change::Alpha(alpha) => Settings { alpha, ..s },
            Change::Value(value) => Settings { value, ..s },
            Change::Steps(steps) => Settings { steps, ..s },
            Change::Chunk(chunk) => Settings { chunk, ..s },
            Change::Delay(delay) => Settings { delay, ..s },
            Change::Margin(margin) => Settings { margin, ..s },
            Change::Ilqr(ilqr) => Settings { ilqr, ..s },
            Change::Disturbance(disturbance) => Settings { disturbance, ..s },
            Change::Trust(trust) => Settings { trust, ..s },
            Change::Instructions(instructions) => Settings { instructions, ..s },
            Change::Cores(cores) => Settings { cores, ..s },
        }
    }
}

/// Why a text is no [`Change`].
#[derive(Debug, thiserror::Error)]
#[error(
    "{text:?} changes no setting of the planner: {why}; give KEY=VALUE with population, elites, \
     temperature, iterations, start (neutral, policy, last), spread, persistence, kept, proposals, noise, \
     alpha (or none), value (critics, fitted), steps, chunk, delay (yes, no), margin, \
     ilqr (yes, no), disturbance (s, or none), trust (or none), instructions (widest, portable), cores (1, 2)"
)]
pub struct ChangeError {
    text: String,
    why: String,
}

impl FromStr for Change {
    type Err = ChangeError;

    fn from_str(text: &str) -> Result<Change, ChangeError> {
        parse(text).map_err(|why| ChangeError { text: text.into(), why })
    }
}

fn parse(text: &str) -> Result<Change, String> {
    let (key, value) = text.split_once('=').ok_or("there is no '='")?;
    let count = |[low, high]: [usize; 2]| match value.parse::<usize>() {
        Ok(x) if (low..=high).contains(&x) => Ok(x),
        _ => Err(format!("{value:?} is not a whole number from {low} to {high}")),
    };
    let lanes = |[low, high]: [usize; 2]| match count([low, high])? {
        x if x % WIDTH == 0 => Ok(x),
        x => Err(format!("{x} is not a multiple of {WIDTH}")),
    };
    let number = |[low, high]: [f64; 2]| match value.parse::<f64>() {
        Ok(x) if (low..=high).contains(&x) => Ok(x),
        _ => Err(format!("{value:?} is not a number from {low} to {high}")),
    };
    let switch = || match value {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err(format!("{value:?} is neither yes nor no")),
    };
    let unless_none = |range| if value == "none" { Ok(None) } else { number(range).map(Some) };
    Ok(match key {
        "population" => Change::Population(lanes([WIDTH, 16384])?),
        "elites" => Change::Elites(count([1, 16384])?),
        "temperature" => Change::Temperature(number([1e-6, 1e3])?),
        "iterations" => Change::Iterations(count([1, 50])?),
        "start" => Change::Start(match value {
            "neutral" => Start::Neutral,
            "policy" => Start::Policy,
            "last" => Start::Last,
            _ => return Err(format!("there is no start {value:?}")),
        }),
        "spread" => Change::Spread(number([0.0, 2.0])?),
        "persistence" => Change::Persistence(number([0.0, 1.0])?),
        "kept" => Change::Kept(count([0, WIDTH - 1])?),
        "proposals" => Change::Proposals(lanes([0, 16384])?),
        "noise" => Change::Noise(number([0.0, 2.0])?),
        "alpha" => Change::Alpha(unless_none([0.0, 1e3])?),
        "value" => Change::Value(match value {
            "critics" => Value::Critics,
            "fitted" => Value::Fitted,
            _ => return Err(format!("there is no value {value:?}")),
        }),
        "steps" => Change::Steps(count([HORIZON, 500])?),
        "chunk" => Change::Chunk(count([1, HORIZON])?),
        "margin" => Change::Margin(number([0.0, 1e3])?),
        "ilqr" => Change::Ilqr(switch()?),
        "delay" => Change::Delay(switch()?),
        "cores" => Change::Cores(count([1, 2])?),
        "instructions" => Change::Instructions(match value {
            "widest" => Instructions::Widest,
            "portable" => Instructions::Portable,
            _ => return Err(format!("there are no instructions {value:?}")),
        }),
        "trust" => Change::Trust(unless_none([0.0, 1e3])?),
        "disturbance" => Change::Disturbance(unless_none([0.01, 60.0])?),
        _ => return Err(format!("there is no setting {key:?}")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_read_and_made() {
        let read = |text: &str| text.parse::<Change>().map_err(|e| e.to_string());
        let changes = [read("spread=0.1"), read("alpha=none"), read("start=policy")];
        let changes: Vec<Change> = changes.into_iter().map(Result::unwrap).collect();
        let changed = Settings::HYBRID.with(&changes);
        let expected =
            Settings { spread: 0.1, alpha: None, start: Start::Policy, ..Settings::HYBRID };
        assert_eq!(changed, expected);
        assert_eq!(Settings::HYBRID.with(&[]), Settings::HYBRID);
        for (text, why) in [
            ("spread", "there is no '='"),
            ("spread=x", "not a number from 0 to 2"),
            ("alpha=NaN", "not a number"),
            ("population=100", "not a multiple of 16"),
            ("population=0", "not a whole number from 16"),
            ("start=there", "no start"),
            ("delay=1", "neither yes nor no"),
            ("cores=3", "not a whole number from 1 to 2"),
            ("speed=1", "no setting \"speed\""),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(why) && error.contains("give KEY=VALUE"), "{error}");
        }
    }
}
