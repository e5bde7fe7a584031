//! Single flights for display: attitude over time, and a planner's candidate plans at chosen times.

use crate::{Environment, Trouble};
use greylag_control::insight::Insight;
use greylag_control::{Controller, Target};
use greylag_model::STEP;

/// Steps at which the planner's candidates are stored.
pub const ASKED: [usize; 3] = [10, 50, 150];

/// A flight towards one target.
#[derive(Clone, Debug)]
pub struct Tracking {
    /// Roll and pitch, rad, at every step; NaN after the loss of the aircraft.
    pub attitude: Vec<[f64; 2]>,
    /// The planner's candidates at the steps [`ASKED`], each with its step.
    pub insights: Vec<(usize, Insight)>,
}

/// Flies towards `target` for `steps` steps of 10 ms. The flight ends early if the aircraft is lost.
///
/// # Errors
///
/// If the environment cannot be reset.
pub fn track(
    environment: &mut dyn Environment,
    controller: &mut dyn Controller,
    target: &Target,
    steps: usize,
) -> Result<Tracking, Trouble> {
    let mut seen = environment.reset()?;
    controller.reset(1);
    let mut flight = Tracking { attitude: Vec::new(), insights: Vec::new() };
    for step in 0..steps {
        let command = controller.command(&seen, target);
        flight.attitude.push([seen.state.roll, seen.state.pitch]);
        if ASKED.contains(&step)
            && let Some(insight) = controller.insight(&seen)
        {
            flight.insights.push((step, insight));
        }
        match environment.step(command) {
            Ok(next) => seen = next,
            Err(_) => break,
        }
    }
    flight.attitude.resize(steps, [f64::NAN; 2]);
    Ok(flight)
}

/// Time of a step after the start, s.
pub fn seconds(step: usize) -> f64 {
    step as f64 * STEP
}
