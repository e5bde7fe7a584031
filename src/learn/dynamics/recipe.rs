//! Settings of the training of a dynamics model.
//!
//! The model's state rates are F_p + F_a. F_p is the prior, a physical model with coefficients. F_a is the residual, a
//! neural network. A rollout simulates the model from a recorded state and is compared with the recorded flight. x_c is
//! the scale of each state, eq. (21) of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`), the paper.

use serde::{Deserialize, Serialize};

use crate::dynamics::loss::Penalty;
use greylag_model::GreyBox;

/// Variants of the training objective from different publications.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// \[GSFM26\]: errors are divided by x_c, and their loss by the loss of the prior alone. The penalty is on ‖F_a‖/‖F_p‖.
    Scaled,
    /// The published methods APHYNITY and PhIHP: errors and their loss are not scaled, and the penalty is on ‖F_a‖.
    Plain,
}

impl Criterion {
    /// Scale by which errors and rates of the eight states are divided.
    pub fn scale(self, model: &GreyBox) -> [f64; 8] {
        match self {
            Criterion::Scaled => model.scale(),
            Criterion::Plain => [1.0; 8],
        }
    }

    /// The penalty on the residual.
    pub fn penalty(self) -> Penalty {
        match self {
            Criterion::Scaled => Penalty::Ratio,
            Criterion::Plain => Penalty::Absolute,
        }
    }
}

/// Initial values of the trained coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// The values of the prior, as in the paper.
    AsGiven,
    /// Estimates of a robust regression of the prior's state rates on short sections of the flights (equation error).
    EquationError,
}

/// Method of training the prior's coefficients together with the residual.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Joint {
    /// By the gradient of the loss over rollouts, with the learning rate [`Recipe::prior_rate`], as in the paper.
    #[default]
    Gradient,
    /// By variable projection with a robust regression: now and then, the part of F_a that a change of the coefficients can
    /// produce moves into the coefficients.
    Projection,
    /// By variable projection with an ordinary least-squares regression, to whose result training by the gradient converges.
    LeastSquares,
}

impl Joint {
    fn is_gradient(&self) -> bool {
        *self == Joint::Gradient
    }
}

/// All settings of a training. Together with the data and the prior they determine the result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Number of units of each hidden layer of the residual.
    pub hidden: Vec<usize>,
    /// Rollout lengths n, in steps of 10 ms. The lengths are used in this order, each for an equal part of the
    /// updates.
    pub steps: Vec<usize>,
    /// Number of rollouts in a minibatch.
    pub batch: usize,
    /// Total number of updates.
    pub updates: u64,
    /// Initial learning rate. A cosine schedule reduces it to `rate_end` times this value.
    pub rate: f64,
    /// Ratio of the final to the initial learning rate.
    pub rate_end: f64,
    /// Initial learning rate of the prior's coefficients; 0 switches the gradient method off. The gradient method minimises
    /// the mean square of F_a. An effect that the prior lacks, for example stall, therefore biases the coefficients.
    pub prior_rate: f64,
    /// Initial values of the trained coefficients.
    pub start: Start,
    /// Method of training the prior's coefficients together with the residual.
    #[serde(default, skip_serializing_if = "Joint::is_gradient")]
    pub joint: Joint,
    /// Initial value λ0 of λ in eq. (24). The penalty on the residual is divided by λ.
    pub lambda: f64,
    /// τ of eq. (24). In each update λ grows by τ times the prediction loss, which [`Criterion::Scaled`] divides by the loss of
    /// the prior alone.
    pub tau: f64,
    /// Variant of the training objective.
    pub criterion: Criterion,
    /// Weights each rollout by 1/(e² + floor²). Here e is the prior's error at the end of the rollout, divided by
    /// the RMS of this error over all rollouts. The residual then has the same relative accuracy where the prior's errors are
    /// small and where they are large (stall). `None` weights all rollouts equally, as in the paper.
    pub floor: Option<f64>,
    /// Full names of the trained coefficients of the prior. If the list is empty, the prior does not change.
    pub trainable: Vec<String>,
    /// Seed of the network's initial weights and of the minibatches.
    pub seed: u64,
}

impl Default for Recipe {
    fn default() -> Self {
        Recipe {
            hidden: vec![64, 64],
            steps: vec![20],
            batch: 64,
            updates: 20_000,
            rate: 3e-3,
            rate_end: 0.01,
            prior_rate: 0.0,
            start: Start::EquationError,
            joint: Joint::Gradient,
            lambda: 1.0,
            tau: 0.02,
            criterion: Criterion::Scaled,
            floor: Some(0.1),
            trainable: Vec::new(),
            seed: 1,
        }
    }
}

impl Recipe {
    /// Description of the first invalid setting; `None` if all are valid.
    pub fn fault(&self) -> Option<&'static str> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if self.steps.is_empty() || self.steps.iter().any(|n| !(1..=500).contains(n)) {
            return Some("rollouts must have 1 to 500 steps");
        }
        if !(1..=65_536).contains(&self.batch) || self.updates == 0 {
            return Some("a minibatch must have 1 to 65536 rollouts, and there must be an update");
        }
        if ![self.rate, self.rate_end, self.lambda].into_iter().all(positive) {
            return Some("the learning rate and lambda must be positive");
        }
        if !(self.prior_rate.is_finite() && self.prior_rate >= 0.0) {
            return Some("the prior's learning rate must not be negative");
        }
        if self.prior_rate > 0.0 && !self.joint.is_gradient() {
            return Some("with a projection the prior's learning rate must be zero");
        }
        if !self.floor.is_none_or(positive) {
            return Some("the floor of a rollout's error must be positive");
        }
        if !(self.tau.is_finite() && self.tau >= 0.0) {
            return Some("tau must not be negative");
        }
        None
    }

    /// Rollout length at the update with the number `update`, in steps.
    pub fn steps_at(&self, update: u64) -> usize {
        let place = update as u128 * self.steps.len() as u128 / u128::from(self.updates.max(1));
        self.steps[(place as usize).min(self.steps.len() - 1)]
    }

    /// Ratio of the learning rate at the update with the number `update` to the initial one.
    pub fn pace_at(&self, update: u64) -> f64 {
        let done = update as f64 / self.updates as f64;
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
        self.rate_end + (1.0 - self.rate_end) * cosine
    }
}
