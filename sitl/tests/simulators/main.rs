//! Tests of the shim in real time and as the simulator of PX4 and ArduPilot.

mod ardupilot_simulator;
mod px4_client;
mod px4_sensors;
mod px4_simulator;
#[path = "../../../tests/support/real_time.rs"]
mod real_time;
mod shim;
#[path = "../support/shim_companion.rs"]
mod shim_companion;
