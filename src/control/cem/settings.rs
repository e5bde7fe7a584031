//! Settings of the CEM planner.

use super::changes::Change;
use super::rollout::HORIZON;
use crate::disturbance::{TIME_CONSTANT_S, TRUST};

/// How an iteration updates the sampling distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update {
    /// Mean and standard deviation of the K best candidates: the cross-entropy method.
    Elites(usize),
    /// Mean and standard deviation of all candidates, weighted with exp(return / λ): MPPI (Williams et al., 2017), λ
    /// in units of the return.
    Weighted(f64),
}

/// Mean of the first iteration's distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The centre of every action's range.
    Neutral,
    /// The policy's own plan.
    Policy,
    /// The last tick's plan, shifted by one tick (iCEM, Pinneri et al., CoRL 2020).
    Last,
}

/// The terminal value function, where critics are used at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// The critics, for every candidate.
    Critics,
    /// A plane fitted to the critics' values of the tick's first 128 candidates; the critics value the best 64 of the
    /// last iteration again. Only without a base controller.
    Fitted,
}

/// Vector instruction set of the rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// The widest that the processor supports.
    Widest,
    /// The baseline of the compilation target. Multiply-adds may round differently, so that a flight repeats to the
    /// bit within one of the two choices, not across them.
    Portable,
}

/// Settings of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Candidates per iteration N, a multiple of 16.
    pub population: usize,
    /// How the sampling distribution is updated.
    pub update: Update,
    /// Iterations I per tick.
    pub iterations: usize,
    /// The initial mean of the distribution.
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
    /// Standard deviation of the noise on the other proposals, and its truncation.
    pub noise: [f64; 2],
    /// Weight α of the critics' terminal value, eq. (26).
    pub alpha: Option<f64>,
    /// The terminal value function of a plan.
    pub value: Value,
    /// Horizon in steps: after the fifth the base controller flies, or the policy without one; without either the
    /// horizon is five.
    pub steps: usize,
    /// Ticks for which a plan is flown before the next one is made, up to 5; with a base controller every tick is
    /// planned.
    pub chunk: usize,
    /// Whether a tick plans for the next one, from the state that the model predicts (RT-HCP's delay of one step), so
    /// that planning may take the whole period. Only without a base controller, and a plan is then flown for one
    /// tick.
    pub delay: bool,
    /// Return by which a plan must exceed the base controller's to be flown.
    pub margin: f64,
    /// Whether iLQR's plan is among the candidates; it needs a base controller.
    pub ilqr: bool,
    /// Time constant of the disturbance estimate, s; `None` disables it.
    pub disturbance: Option<f64>,
    /// Largest relative one-step prediction error (root mean square over the last half second) at which plans are
    /// made. Above it, unless the error looks like gusts, the base controller flies alone, or without one the policy;
    /// one of them is required.
    pub trust: Option<f64>,
    /// Largest distance from the training data of the model's residual, see
    /// [`Residual::distance`](greylag_model::Residual::distance), at which plans are made (1 holds 99.9 % of the
    /// training samples); beyond it, the same fallback as for `trust`.
    pub known: Option<f64>,
    /// Vector instruction set of the rollouts.
    pub instructions: Instructions,
    /// Number of cores used by the rollouts, one or two; the commands are identical.
    pub cores: usize,
}

impl Settings {
    /// CEM-MPC alone. H = 5 as in the paper; N, K and I are not stated there: 1024 rollouts per tick in all.
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
    /// CEM with the policy's proposals (CEM + π).
    pub const POLICY: Settings = Settings { proposals: 32, ..Settings::PAPER };
    /// CEM with the critics' terminal value (CEM + Q).
    pub const CRITICS: Settings = Settings { alpha: Some(1.0), ..Settings::PAPER };
    /// The hybrid controller. It searches close to the policy's plan: critics are accurate to a few per cent of a
    /// return, and a wider search exploits their errors (with a spread of 1 about the centre of the range and
    /// proposals spread by 0.2, it is worse than the policy itself).
    pub const HYBRID: Settings = Settings {
        alpha: Some(1.0),
        start: Start::Policy,
        spread: 0.02,
        noise: [0.02, 0.06],
        trust: Some(TRUST),
        ..Settings::POLICY
    };
    /// The hybrid controller whose policy continues after each plan up to step 40 in the model, before the critics
    /// value the terminal state. It performs equally well without critics.
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
    /// The hybrid controller over an LQI, which continues after each plan and so replaces the critics' terminal
    /// value. Offset-free.
    ///
    /// The margin corresponds to 0.12° of attitude error over all steps: smaller gains are sampling noise, and flying
    /// them opens the loop of the LQI's integrators (hard targets settle at 0.04° with a margin of 0.002, at 0.001°
    /// with 0.05).
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

    /// Whether the search requires a policy.
    pub(crate) fn needs_policy(&self) -> bool {
        self.proposals > 0 || self.alpha.is_some() || self.start == Start::Policy
    }

    /// These settings with `changes` applied in order.
    pub fn with(self, changes: &[Change]) -> Settings {
        changes.iter().fold(self, |settings, change| change.made(settings))
    }
}
