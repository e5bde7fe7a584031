//! Flying a controller and scoring it: environments, targets, episodes, evaluations.

pub mod collect;
pub mod environment;
pub mod episode;
pub mod evaluation;
pub mod targets;

pub use environment::{Environment, Imagined, Simulator, Trouble};
pub use episode::{Episode, Outcome};
pub use targets::{Group, TargetFile};
