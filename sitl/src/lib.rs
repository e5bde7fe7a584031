//! Simulation of an aircraft with JSBSim in the same process, and the MAVLink shim that simulates its flight controller.

pub mod air;
mod aircraft;
pub mod arguments;
pub mod airframe_file;
pub mod error_arguments;
pub mod hidden;
pub mod parameter_file;
pub mod plant;
pub mod plant_arguments;
pub mod shim;
mod text_file;
