//! The companion over pseudo-terminals at 921600 baud, in real time.
#![cfg(feature = "sitl")]

#[path = "../support/controller.rs"]
mod controller_support;
mod controllers;
mod flight;
#[path = "../support/flight.rs"]
mod flight_support;
#[path = "../support/real_time.rs"]
mod real_time;
#[path = "../support/shim.rs"]
mod shim_support;
mod wire_support;
