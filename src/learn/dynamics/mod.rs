//! Learning a grey-box model from flights: the coefficients of its physical effects (the prior) and a network (the residual)
//! together, section IV-A of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`).

pub(super) mod basis;
pub(super) mod engine;
pub(super) mod equation_error;
pub mod export;
pub(super) mod kernel;
pub(super) mod loss;
pub(super) mod network;
pub(super) mod packet;
pub(super) mod prior;
pub(super) mod projection;
pub(super) mod recipe;
pub mod resample;
pub mod residual_map;
pub(super) mod rollout;
pub mod score;
pub(super) mod trainer;
pub mod windows;
