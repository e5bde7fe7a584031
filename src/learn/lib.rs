//! Learning of grey-box models from flights, and of policies in simulation. A grey-box model is a physical prior plus a neural
//! residual; both are learned together (section IV-A of the paper \[GSFM26\], see `src/lib.rs`). A policy is a neural network
//! that commands the aircraft; it is learned in simulations of a model or of JSBSim (section IV-B).

mod adam;
mod checkpoint;
pub mod dynamics;
pub mod policy;

pub use adam::Adam;
pub use checkpoint::write_whole;
pub use checkpoint::{Checkpoint, CheckpointError};
pub use dynamics::basis::{JXZ, TrainableError, trainable};
pub use dynamics::engine::{Arithmetic, Engine};
pub use dynamics::loss::{Loss, Objective, Penalty};
pub use dynamics::network::Passes;
pub use dynamics::recipe::{Criterion, Joint, Recipe, Start};
pub use dynamics::rollout::{Gradient, PriorSlopes, Subject};
pub use dynamics::trainer::{Learned, Moment, Progress, TrainError, Trainer};
pub use policy::analytic::{AnalyticProgress, AnalyticRecipe, AnalyticTrainer};
pub use policy::critic_fit::{Valuation, ValuationError, ValuationProgress, ValuationRecipe};
pub use policy::mlp::{Mlp, Moments, Optimiser};
pub use policy::replay::{Batch, Replay, Transition};
pub use policy::td3::{Hyperparameters, Losses, Standing, Td3};
pub use policy::trainer::{
    PolicyError, PolicyProgress, PolicyRecipe, PolicyStanding, PolicyTrainer,
};
