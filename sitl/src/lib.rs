//! JSBSim in process, and the MAVLink shim that plays the flight controller.

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
