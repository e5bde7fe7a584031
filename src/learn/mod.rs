//! Learning: the grey box from flights, prior and residual together, section IV-A of \[GSFM26\].

mod adam;
mod basis;
mod checkpoint;
mod dynamics;
pub mod export;
mod engine;
mod equation_error;
mod kernel;
mod loss;
mod network;
mod packet;
pub mod portrait;
mod prior;
mod recipe;
mod rollout;
pub mod score;
pub mod windows;

pub use adam::Adam;
pub use basis::{JXZ, TrainableError, trainable};
pub use checkpoint::{Checkpoint, CheckpointError};
pub use dynamics::{Learned, Moment, Progress, TrainError, Trainer};
pub use engine::{Arithmetic, Engine};
pub use loss::{Loss, Objective, Penalty};
pub use network::Passes;
pub use recipe::{Criterion, Recipe, Start};
pub use rollout::{Gradient, PriorSlopes, Subject};
