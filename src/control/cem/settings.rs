//! Size and shape of the search.

use super::changes::Change;
use super::rollout::HORIZON;
use crate::disturbance::{TIME_CONSTANT_S, TRUST};

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
    /// How the next distribution is made of the candidates.
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
    /// Best candidates carried over to the next iteration (the kept elites of iCEM), fewer than 16.
    pub kept: usize,
    /// Candidates of the first iteration that the policy proposes, a multiple of 16; the first of them
    /// without noise.
    pub proposals: usize,
    /// Standard deviation of the noise on the others, and where it is cut off.
    pub noise: [f64; 2],
    /// Weight α of the critics' value of the end, eq. (26).
    pub alpha: Option<f64>,
    /// What gives the value of a plan's end.
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
    /// for plans to be made; above it, unless what they missed is like gusts, the base flies alone, or without one the policy.
    /// It needs either of them.
    pub trust: Option<f64>,
    /// Largest distance from the data that the model's residual was trained on, see
    /// [`Residual::distance`](greylag_model::Residual::distance), at which plans are made
    /// (1 holds 99.9 % of the training samples); beyond it, as with `trust`.
    pub known: Option<f64>,
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
        known: None,
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
        trust: Some(TRUST),
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
        disturbance: Some(TIME_CONSTANT_S),
        trust: Some(TRUST),
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
