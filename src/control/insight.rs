//! What a planner had before it when it chose: for a reader, not for the flight.

use std::time::Duration;

/// Roll and pitch (rad) of an imagined aircraft, now and after each step.
pub type Path = Vec<[f64; 2]>;

/// One tick of a planner.
#[derive(Clone, Debug, PartialEq)]
pub struct Insight {
    /// Some of the last candidates, flown in the model.
    pub candidates: Vec<Path>,
    /// What was chosen.
    pub chosen: Path,
    /// Whether the search found it; if not, the base controller (or the policy) flies.
    pub searched: bool,
    /// Time that the parts of the tick took, in their order.
    pub phases: Vec<(&'static str, Duration)>,
}
