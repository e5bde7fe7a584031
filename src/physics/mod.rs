//! The nouns of flight: state, controls, air, wrench, airframe, actuators and the rigid body.
//!
//! Units are SI and radians; body axes are forward-right-down (FRD), earth axes north-east-down.

pub mod actuators;
mod state;
mod time;

pub use actuators::{ActuatorState, Command, Controls};
pub use state::State;
pub use time::Time;
