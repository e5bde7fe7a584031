//! Flying a controller and scoring it: environments, targets, episodes, evaluations, flight tests.

pub mod collect;
pub mod design;
pub mod environment;
pub mod episode;
pub mod evaluation;
pub mod flight_test;
pub mod instruments;
pub mod missing;
pub mod starting_model;
pub mod targets;
pub mod trial;

pub use environment::{Environment, Imagined, Simulator, Trouble};
pub use episode::{Episode, Outcome};
pub use targets::{Group, TargetFile};
