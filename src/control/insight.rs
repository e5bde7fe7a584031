//! Candidates and choice of one planner tick, for display.

use std::time::Duration;

/// Roll and pitch (rad) of a simulated aircraft, now and after each step.
pub type Path = Vec<[f64; 2]>;

/// One tick of a planner.
#[derive(Clone, Debug, PartialEq)]
pub struct Insight {
    /// Some of the last candidates, simulated with the model.
    pub candidates: Vec<Path>,
    /// The path that was chosen.
    pub chosen: Path,
    /// Whether the search's plan is flown; otherwise the base controller or the policy flies.
    pub searched: bool,
    /// Processing time of each part of the tick, in order.
    pub phases: Vec<(&'static str, Duration)>,
}
