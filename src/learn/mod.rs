//! Learning: the grey box from flights, prior and residual together, section IV-A of \[GSFM26\].

mod adam;
mod basis;
mod checkpoint;
mod dynamics;
mod analytic;
pub mod export;
mod engine;
mod kernel;
mod loss;
mod mlp;
mod network;
mod packet;
mod policy;
mod policy_checkpoint;
mod prior;
mod recipe;
mod replay;
mod rollout;
pub mod score;
mod td3;
pub mod windows;

pub use adam::Adam;
pub use analytic::{AnalyticProgress, AnalyticRecipe, AnalyticTrainer};
pub use basis::{JXZ, TrainableError, trainable};
pub use checkpoint::{Checkpoint, CheckpointError};
pub(crate) use checkpoint::write_whole;
pub use dynamics::{Progress, TrainError, Trainer};
pub use engine::{Arithmetic, Engine};
pub use loss::{Loss, Objective, Penalty};
pub use network::Passes;
pub use mlp::{Mlp, Moments, Optimiser};
pub use policy::{PolicyError, PolicyProgress, PolicyRecipe, PolicyStanding, PolicyTrainer};
pub use recipe::{Criterion, Recipe};
pub use replay::{Batch, Replay, Transition};
pub use rollout::{Gradient, PriorSlopes, Subject};
pub use td3::{Hyperparameters, Losses, Standing, Td3};
