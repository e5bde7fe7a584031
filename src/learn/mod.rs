//! Learning: the grey box from flights, prior and residual together, section IV-A of \[GSFM26\].

mod engine;
mod kernel;
mod loss;
mod network;
mod packet;
mod prior;
mod rollout;
pub mod windows;

pub use engine::{Arithmetic, Engine};
pub use kernel::Instructions;
pub use loss::{Loss, Objective, Penalty};
pub use network::Passes;
pub use rollout::{Gradient, PriorSlopes, Subject};
