//! Controllers and schedules, flown in JSBSim and in models.

#[cfg(feature = "sitl")]
mod any_aircraft;
mod check;
#[cfg(feature = "sitl")]
mod envelope;
mod hybrid;
#[cfg(feature = "sitl")]
mod quality;
#[cfg(feature = "sitl")]
mod schedule;
#[cfg(feature = "sitl")]
mod shipped_controller;
#[cfg(feature = "sitl")]
mod yardsticks;
