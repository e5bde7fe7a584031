//! Data about one tick of a planner (control cycle of 10 ms), for display: the candidate plans that it compared and its choice.

use std::time::Duration;

/// Roll and pitch (rad) of a simulated aircraft at the present time and after each step.
pub type Path = Vec<[f64; 2]>;

/// Data about one tick of a planner.
#[derive(Clone, Debug, PartialEq)]
pub struct Insight {
    /// Some of the candidates of the last iteration, simulated with the model.
    pub candidates: Vec<Path>,
    /// The path that follows from the commands that are flown, simulated with the model.
    pub chosen: Path,
    /// Whether the search's plan is flown. If false, the base controller or the policy flies.
    pub searched: bool,
    /// Name and computation time of each phase of the tick, in order.
    pub phases: Vec<(&'static str, Duration)>,
}
