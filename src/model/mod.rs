//! The grey box: a prior made of physical effects, its integrators, trim and linearisation.

mod file;
mod grey_box;
mod integrator;
mod linear;
mod newton;
pub mod residual;
mod trim;

pub use grey_box::{GreyBox, JoinError, Named};
pub(crate) use integrator::advance_jsbsim;
pub use integrator::{Integrator, Memory, STEP, Twin};
pub use linear::{Linear, linearise};
pub use residual::Residual;
pub use trim::{Trim, TrimError};
