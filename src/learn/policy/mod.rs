//! Policies and critics, learned by reinforcement learning in a model or in JSBSim.

pub(super) mod analytic;
pub(super) mod checkpoint;
pub(super) mod critic_fit;
pub mod learning_curve;
pub(super) mod mlp;
pub(super) mod replay;
pub(super) mod td3;
pub(super) mod trainer;
