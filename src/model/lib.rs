//! The grey-box model: physical effects, integrators, trim and linearisation.

#[cfg(feature = "learn")]
pub mod block;
mod calls;
pub mod data_envelope;
pub mod derivatives;
mod draw;
pub mod edit;
mod file;
mod forces;
mod grey_box;
mod integrator;
mod jacobian;
mod join;
pub mod known;
mod linear;
pub mod jsbsim;
pub mod modes;
pub mod plausible;
pub mod population;
mod newton;
pub mod residual;
#[cfg(feature = "slopes")]
mod slopes;
pub mod textbook;
mod trim;
pub mod weights;

#[cfg(feature = "learn")]
pub use forces::{Starting, Weights, parted};
pub use grey_box::{GreyBox, Named, RUDDER};
#[cfg(feature = "learn")]
pub use integrator::advance_jsbsim;
pub use integrator::{Integrator, Memory, STEP, Twin};
pub use join::JoinError;
pub use known::{FlightConstants, Known};
pub use linear::{Linear, linearise, linearise_step};
pub use residual::Residual;
#[cfg(feature = "slopes")]
pub use slopes::{SLOPES, Sloped};
pub use trim::{Trim, TrimError};
