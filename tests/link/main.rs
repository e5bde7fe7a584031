//! MAVLink: frames, clients, vehicles, routing, transports, and inputs made to break them.

mod client;
mod controllers;
mod framing;
mod fuzz;
mod fuzz_support;
mod link_support;
mod mutation;
#[cfg(feature = "sitl")]
mod routing;
mod setpoints;
mod transport;
mod vehicle;
