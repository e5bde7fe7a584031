//! MAVLink: addresses, transports, frames, and the two sides of the companion.
//!
//! Everything but the transport is free of sockets and clocks: bytes and the time come in as
//! arguments, bytes go out as return values. [`transport`] runs on tokio and hands datagrams and
//! streams over channels. [`vehicle`] speaks to the flight controller, [`client`] to ground
//! stations and offboard programs; `wire` is the one place that names MAVLink messages.

pub mod address;
pub mod autopilot;
pub mod client;
pub mod framing;
pub mod offboard;
pub mod peer;
pub mod transport;
pub mod vehicle;
mod wire;
