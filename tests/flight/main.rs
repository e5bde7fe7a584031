//! The pilot and the companion in lockstep, in this process.

#[cfg(feature = "sitl")]
#[path = "../support/controller.rs"]
mod controller_support;
#[cfg(feature = "sitl")]
mod controllers;
#[cfg(feature = "sitl")]
#[path = "../support/flight.rs"]
mod flight_support;
#[cfg(feature = "sitl")]
mod monitor;
mod pilot;
#[cfg(feature = "sitl")]
mod planners_beside_controllers;
#[cfg(feature = "sitl")]
mod policies;
#[cfg(feature = "sitl")]
mod sign_check;
