//! The recipe of a training: what is minimised, over what, how long.

use serde::{Deserialize, Serialize};

use crate::dynamics::loss::Penalty;
use greylag_model::GreyBox;

/// Whose loss is minimised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// \[GSFM26\]: scaled by x_c, divided by the bare prior's error, ‖F_a‖/‖F_p‖ kept small.
    Scaled,
    /// APHYNITY's and PhIHP's: x_c = 1, not divided, ‖F_a‖ kept small. PhIHP leaves the prior frozen.
    Plain,
}

impl Criterion {
    /// The scale of errors and rates.
    pub fn scale(self, model: &GreyBox) -> [f64; 8] {
        match self {
            Criterion::Scaled => model.scale(),
            Criterion::Plain => [1.0; 8],
        }
    }

    /// How the residual is kept small.
    pub fn penalty(self) -> Penalty {
        match self {
            Criterion::Scaled => Penalty::Ratio,
            Criterion::Plain => Penalty::Absolute,
        }
    }
}

/// Where the trained coefficients start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// At the prior's, as in the paper.
    AsGiven,
    /// Where a robust regression on short windows puts them.
    EquationError,
}

/// How the prior's coefficients are learned along with the residual.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Joint {
    /// By the gradient of the rollouts, at [`Recipe::prior_rate`]: the paper's.
    #[default]
    Gradient,
    /// By variable projection, robust: what of the residual the prior can say moves into its coefficients.
    Projection,
    /// Likewise by least squares: where the gradient would end.
    LeastSquares,
}

impl Joint {
    fn is_gradient(&self) -> bool {
        *self == Joint::Gradient
    }
}

/// Everything that decides what a training gives, but for data and prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Units of the hidden layers of the residual.
    pub hidden: Vec<usize>,
    /// Lengths of the rollouts n, in steps: equal shares of the updates have each in turn.
    pub steps: Vec<usize>,
    /// Rollouts in a minibatch.
    pub batch: usize,
    /// Updates in all.
    pub updates: u64,
    /// Learning rate at the start; it falls as a cosine.
    pub rate: f64,
    /// Part of it that is left at the end.
    pub rate_end: f64,
    /// Learning rate of the prior's coordinates at the start; 0 holds them where they start. Moved along,
    /// they make the residual as small as it can be in the mean square: what the prior lacks where it
    /// lacks most, as a stall, then bends them.
    pub prior_rate: f64,
    /// Where the trained coefficients start.
    pub start: Start,
    /// How they are learned along.
    #[serde(default, skip_serializing_if = "Joint::is_gradient")]
    pub joint: Joint,
    /// λ0 of eq. (24).
    pub lambda: f64,
    /// τ of eq. (24), by which λ grows an update.
    pub tau: f64,
    /// Whose loss.
    pub criterion: Criterion,
    /// Count each rollout by 1/(e² + floor²), e being how far the prior is off at its end, in root mean
    /// squares over the rollouts: the residual is then as good where the prior errs little as where it
    /// errs most, as in a stall. All count alike without it, as in the paper.
    pub floor: Option<f64>,
    /// Full names of the prior's coefficients that are trained; none for a frozen prior.
    pub trainable: Vec<String>,
    /// Seed of the network's start and of the minibatches.
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
    /// What is wrong with it, if anything is.
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

    /// The rollouts' length at an update.
    pub fn steps_at(&self, update: u64) -> usize {
        let place = update as u128 * self.steps.len() as u128 / u128::from(self.updates.max(1));
        self.steps[(place as usize).min(self.steps.len() - 1)]
    }

    /// What is left of the learning rates at an update.
    pub fn pace_at(&self, update: u64) -> f64 {
        let done = update as f64 / self.updates as f64;
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
        self.rate_end + (1.0 - self.rate_end) * cosine
    }
}
