//! Reinforcement learning of policies (networks that command the aircraft) and critics (networks that estimate the sum of
//! future rewards), in simulations of a model or of JSBSim.

pub(super) mod analytic;
pub(super) mod checkpoint;
pub(super) mod critic_fit;
pub mod learning_curve;
pub(super) mod mlp;
pub(super) mod replay;
pub(super) mod td3;
pub(super) mod trainer;
