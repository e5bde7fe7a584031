//! JSBSim in process, and the MAVLink shim that plays the flight controller.

pub mod plant;
pub mod shim;
