//! What a training says of itself: why it failed, how an update went, what was learned.

use serde::{Deserialize, Serialize};

use crate::checkpoint::CheckpointError;
use crate::dynamics::basis::TrainableError;
use crate::dynamics::loss::Loss;
use greylag_model::residual::ResidualError;
use greylag_num::dense::DenseError;

/// Why a training cannot begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The recipe makes no sense.
    #[error("the training's options: {0}")]
    Recipe(&'static str),
    /// A coefficient cannot be trained.
    #[error(transparent)]
    Trainable(#[from] TrainableError),
    /// The network cannot be made.
    #[error(transparent)]
    Network(#[from] DenseError),
    /// Prior and network do not fit.
    #[error(transparent)]
    Residual(#[from] ResidualError),
    /// There is too little data.
    #[error(
        "the flights have no stretch of {0} samples without a gap, which one rollout takes; give longer logs, or shorter rollouts"
    )]
    Data(usize),
    /// The bare prior cannot follow the flights at all.
    #[error(
        "model {0} leaves the numbers on most rollouts before anything is learned: it is no model of this aircraft, or the logs are of another"
    )]
    Prior(String),
    /// The loss has left the numbers.
    #[error(
        "the loss left the numbers at update {update}; what was learned before is kept in the last checkpoint: go on from it with a smaller learning rate"
    )]
    Diverged {
        /// The update.
        update: u64,
    },
    /// A checkpoint does not fit.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

/// How an update, or several, went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Updates made.
    pub update: u64,
    /// Rollouts' length.
    pub steps: usize,
    /// Mean over the updates since the last report.
    pub loss: Loss,
    /// L_pred/L_prior, eq. (23), likewise.
    pub normalised: f64,
    /// λ.
    pub lambda: f64,
}

/// How a training stood at a moment, as its report shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// Updates made.
    pub update: u64,
    /// L_pred/L_prior, eq. (23).
    pub normalised: f64,
    /// ‖F_a‖/‖F_p‖.
    pub ratio: f64,
    /// λ.
    pub lambda: f64,
    /// The trained coefficients, in the order of [`Trainer::coefficients`](super::Trainer::coefficients).
    pub coefficients: Vec<f64>,
}

/// A coefficient of the prior that was trained.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Learned {
    /// Full name.
    pub name: String,
    /// Value in the prior's file.
    pub start: f64,
    /// Value now.
    pub value: f64,
    /// The true value, where it is known.
    pub truth: Option<f64>,
}
