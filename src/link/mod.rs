//! MAVLink: addresses, transports, frames, and the two sides of the companion.
//!
//! Everything but the transports is free of sockets and clocks: bytes and the time come in as
//! arguments, bytes go out as return values. The transports (`udp`, `tcp`) run on tokio and hand
//! datagrams and streams over channels.

pub mod autopilot;
