//! Reports of the training of a dynamics model: errors, progress and trained coefficients.
//!
//! The model is a prior (a physical model) plus a residual network. The numbers of equations refer to \[GSFM26\] (see
//! `src/lib.rs`).

use serde::{Deserialize, Serialize};

use crate::checkpoint::CheckpointError;
use crate::dynamics::basis::TrainableError;
use crate::dynamics::loss::Loss;
use greylag_model::residual::ResidualError;
use greylag_num::dense::DenseError;

/// Reason why a training cannot start or continue.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A setting of the training is invalid.
    #[error("the training's options: {0}")]
    Recipe(&'static str),
    /// A coefficient cannot be trained.
    #[error(transparent)]
    Trainable(#[from] TrainableError),
    /// The network cannot be built.
    #[error(transparent)]
    Network(#[from] DenseError),
    /// Prior and network are incompatible.
    #[error(transparent)]
    Residual(#[from] ResidualError),
    /// There is too little data.
    #[error(
        "the flights have no stretch of {0} samples without a gap, which one rollout takes; give longer logs, or shorter rollouts"
    )]
    Data(usize),
    /// The prior without a residual diverges on more than half of the rollouts.
    #[error(
        "model {0} diverges on most rollouts before training starts: it is not a model of this aircraft, or the logs are of another"
    )]
    Prior(String),
    /// The loss or its gradient was not finite in too many consecutive updates.
    #[error(
        "the loss is not finite at update {update}; the last checkpoint has the result of earlier updates: continue from it with a smaller learning rate"
    )]
    Diverged {
        /// Number of the update.
        update: u64,
    },
    /// The checkpoint is incompatible.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

/// Progress of one or several updates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Number of updates made.
    pub update: u64,
    /// Length of the rollouts, steps of 10 ms.
    pub steps: usize,
    /// Mean loss over the updates since the last report. `lost` is the sum over these updates.
    pub loss: Loss,
    /// Mean over these updates of the prediction loss divided by that of the prior alone, L_pred/L_prior, eq. (23).
    pub normalised: f64,
    /// λ of eq. (24): the penalty on the residual is divided by it.
    pub lambda: f64,
}

/// State of a training at a report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// Number of updates made.
    pub update: u64,
    /// Prediction loss divided by that of the prior alone, L_pred/L_prior, eq. (23).
    pub normalised: f64,
    /// Ratio ‖F_a‖/‖F_p‖ of the state rates of residual and prior, eq. (22).
    pub ratio: f64,
    /// λ of eq. (24): the penalty on the residual is divided by it.
    pub lambda: f64,
    /// The trained coefficients, in the order of [`Trainer::coefficients`](super::Trainer::coefficients).
    pub coefficients: Vec<f64>,
}

/// A trained coefficient of the prior.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Learned {
    /// Full name of the coefficient.
    pub name: String,
    /// Value in the prior's file.
    pub start: f64,
    /// Present value of the coefficient.
    pub value: f64,
    /// The true value; `None` if it is unknown.
    pub truth: Option<f64>,
}
