//! Simulation and scoring of controllers. An environment is JSBSim or a learned model. An episode is one flight in it to a
//! target, a commanded attitude. An evaluation scores a controller over many episodes. Flight tests produce logs for
//! identification.

#[cfg(feature = "sitl")]
pub mod collect;
#[cfg(feature = "sitl")]
pub mod described;
#[cfg(all(feature = "sitl", feature = "study"))]
pub mod design;
pub mod attitudes;
pub mod changes;
pub mod environment;
pub mod episode;
pub mod evaluation;
#[cfg(feature = "sitl")]
pub mod faults;
#[cfg(feature = "sitl")]
pub mod flight_test;
#[cfg(all(feature = "sitl", feature = "learn"))]
pub mod flown;
#[cfg(feature = "sitl")]
mod hidden_formula;
#[cfg(feature = "learn")]
pub mod imagined;
#[cfg(feature = "sitl")]
pub mod import;
pub mod installation;
#[cfg(feature = "sitl")]
pub mod instruments;
#[cfg(feature = "sitl")]
pub mod missing;
pub mod one_step;
#[cfg(feature = "sitl")]
mod simulator;
#[cfg(feature = "sitl")]
pub mod starting_model;
pub mod steps;
pub mod summary;
#[cfg(feature = "sitl")]
pub mod published;
pub mod targets;
#[cfg(feature = "sitl")]
pub mod tracking;
#[cfg(feature = "sitl")]
pub mod trial;
#[cfg(feature = "learn")]
pub mod world;

pub use environment::{Environment, Imagined, Trouble};
pub use episode::{Episode, Outcome};
#[cfg(feature = "sitl")]
pub use simulator::Simulator;
pub use targets::{Group, TargetFile};

/// Altitude above sea level at the start of an episode, m.
pub const START_ALTITUDE: f64 = 600.0;
