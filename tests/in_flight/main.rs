//! The companion in real time, over real sockets and as a program.

#[cfg(feature = "sitl")]
#[path = "../support/controller.rs"]
mod controller_support;
#[path = "../support/flight.rs"]
mod flight_support;
mod fly_command;
#[cfg(feature = "sitl")]
mod other_aircraft;
#[path = "../support/real_time.rs"]
mod real_time;
#[cfg(feature = "sitl")]
mod recording;
mod runtime;
#[cfg(feature = "sitl")]
mod shim;
#[cfg(feature = "sitl")]
#[path = "../support/shim.rs"]
mod shim_support;
