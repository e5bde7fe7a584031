//! Flight physics: state, controls, air, forces and moments, airframe, actuators, sensors and the rigid body.
//!
//! Units are SI and radians. Body axes are forward-right-down (FRD), earth axes north-east-down (NED).

pub mod actuators;
pub mod airframe;
pub mod atmosphere;
pub mod catalogue;
pub mod effects;
pub mod formula;
pub mod inputs;
pub mod mixer;
pub mod point;
pub mod rigid_body;
pub mod sensors;
pub mod servos;
pub mod size;
mod state;
pub mod text_file;
mod time;
mod wrench;

pub use actuators::{ActuatorState, Command, Controls};
pub use airframe::Airframe;
pub use point::{AirData, Point};
pub use sensors::Sensors;
pub use state::State;
pub use time::Time;
pub use wrench::{Channel, Wrench};
