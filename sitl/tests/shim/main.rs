//! Tests of the shim in lockstep over MAVLink.

mod codec;
mod lockstep;
#[cfg(unix)]
mod program;
mod sensors;
#[path = "../support/shim_companion.rs"]
mod shim_companion;
mod signs;
