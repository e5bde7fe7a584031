//! Settings of the CEM planner (cross-entropy method). Every control tick it samples candidate plans, simulates them with the
//! model, and ranks them by their return, the sum of the rewards. Critics are networks that estimate the further return from the
//! terminal state of a plan. The base controller is an LQI that flies where no plan is better. "The paper" is \[GSFM26\] (see
//! `src/lib.rs`).

use super::changes::Change;
use super::rollout::HORIZON;
use crate::disturbance::{TIME_CONSTANT_S, TRUST};

/// How an iteration updates the sampling distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Update {
    /// Mean and standard deviation of the K best candidates: the cross-entropy method.
    Elites(usize),
    /// Mean and standard deviation of all candidates, weighted with exp(return / λ): MPPI (Williams et al., 2017). λ is in
    /// units of the return.
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

/// The function that evaluates the terminal states, if the settings include a terminal value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// The critics evaluate every candidate.
    Critics,
    /// The critics evaluate the tick's first 128 candidates. A linear function fitted to these values evaluates the others. The
    /// critics evaluate the best 64 of the last iteration again. The setting is available only without a base controller.
    Fitted,
}

/// Vector instruction set of the rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// The widest instruction set that the processor supports.
    Widest,
    /// AVX2, if the processor supports it, even where it supports AVX-512.
    Avx2,
    /// The baseline of the compilation target. Its multiply-adds may round differently from those of the widest set. A
    /// flight is therefore bit-identical only when it is repeated with the same choice.
    Portable,
}

/// Settings of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Number N of candidates per iteration, a multiple of 16.
    pub population: usize,
    /// How the sampling distribution is updated.
    pub update: Update,
    /// Number I of iterations per tick.
    pub iterations: usize,
    /// The initial mean of the distribution.
    pub start: Start,
    /// Standard deviation of the first iteration's distribution, in units of the action (−1..1).
    pub spread: f64,
    /// Correlation of a candidate's noise from one step to the next, 0..1 (first-order coloured noise, as in iCEM).
    pub persistence: f64,
    /// Number of best candidates carried over to the next iteration (the kept elites of iCEM), fewer than 16.
    pub kept: usize,
    /// Number of candidates of the first iteration that the policy proposes, a multiple of 16. The first proposal has no
    /// noise.
    pub proposals: usize,
    /// Standard deviation and largest magnitude of the noise on the other proposals, in units of the action.
    pub noise: [f64; 2],
    /// Weight α of the critics' terminal value, eq. (26). `None` omits the terminal value.
    pub alpha: Option<f64>,
    /// The terminal value function of a plan.
    pub value: Value,
    /// Horizon in steps. The base controller, or the policy if there is none, flies the steps after the fifth. Without
    /// either the horizon is five steps.
    pub steps: usize,
    /// Number of ticks, up to 5, for which a plan is flown before the next plan is made. With a base controller every tick
    /// is planned.
    pub chunk: usize,
    /// Whether a tick plans for the next tick, from the state that the model predicts. Planning may then take the whole
    /// period, and a plan is flown for one tick. The setting has an effect only without a base controller.
    pub delay: bool,
    /// Amount by which a plan's return must exceed the base controller's return before the plan is flown.
    pub margin: f64,
    /// Whether iLQR's plan is among the candidates, which requires a base controller.
    pub ilqr: bool,
    /// Time constant of the disturbance estimate, s. `None` disables the estimate.
    pub disturbance: Option<f64>,
    /// Largest relative one-step prediction error (root mean square over the last half second) at which plans are made. A
    /// larger error is ignored if it is uncorrelated with the predictions, as gusts are. Otherwise the base controller flies
    /// alone, or the policy if there is no base controller. One of the two is required. `None` disables the check.
    pub trust: Option<f64>,
    /// Largest distance from the training data of the model's residual network, see
    /// [`Residual::distance`](greylag_model::Residual::distance), at which plans are made. 99.9 % of the training samples have
    /// a distance of at most 1. Beyond the limit the fallback is that of `trust`. `None` disables the check.
    pub known: Option<f64>,
    /// Vector instruction set of the rollouts.
    pub instructions: Instructions,
    /// Number of cores used by the rollouts, one or two. The number does not change the commands.
    pub cores: usize,
}

impl Settings {
    /// CEM-MPC without policy and critics, with 1024 rollouts per tick. The horizon H = 5 is the paper's. The paper does not
    /// state N, I, and the number K of best candidates.
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
    /// The hybrid controller: CEM with the policy's proposals and the critics' terminal value. It searches close to the
    /// policy's plan, because the critics are accurate only to a few per cent of a return and a wider search exploits their
    /// errors. With a spread of 1 about the centre of the range and a proposal noise of 0.2, it performs worse than the policy.
    pub const HYBRID: Settings = Settings {
        alpha: Some(1.0),
        start: Start::Policy,
        spread: 0.02,
        noise: [0.02, 0.06],
        trust: Some(TRUST),
        ..Settings::POLICY
    };
    /// The hybrid controller with a longer horizon: the policy flies the model from the end of each plan to step 40, where
    /// the critics evaluate the terminal state. It performs equally well without critics.
    pub const OVER_POLICY: Settings = Settings {
        population: 64,
        update: Update::Elites(8),
        iterations: 3,
        proposals: 16,
        steps: 40,
        ..Settings::HYBRID
    };
    /// MPPI with the rollouts of `Settings::PAPER`.
    pub const MPPI: Settings = Settings { update: Update::Weighted(0.01), ..Settings::PAPER };
    /// The search with an LQI as base controller. The LQI flies the steps after each plan. The rewards of these steps replace
    /// the critics' terminal value.
    ///
    /// The margin corresponds to an attitude error of 0.12° at all steps. Smaller improvements are sampling noise. Flying such
    /// plans would keep the LQI's integrators from removing the steady-state error. On hard targets this error is 0.04° with
    /// a margin of 0.002, and 0.001° with 0.05.
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

    /// Whether the search requires a policy, with or without its critics.
    pub(crate) fn needs_policy(&self) -> bool {
        self.proposals > 0 || self.alpha.is_some() || self.start == Start::Policy
    }

    /// These settings with `changes` applied in order.
    pub fn with(self, changes: &[Change]) -> Settings {
        changes.iter().fold(self, |settings, change| change.made(settings))
    }
}
