//! The grey box: a prior made of physical effects, its integrators, trim and linearisation.

pub mod edit;
mod file;
mod forces;
mod grey_box;
mod integrator;
mod join;
mod linear;
mod newton;
mod trim;

pub use grey_box::{GreyBox, Named};
pub use integrator::{Integrator, Memory, STEP, Twin};
pub use join::JoinError;
pub use linear::{Linear, linearise};
pub use trim::{Trim, TrimError};
