//! One episode of the paper's protocol: 1000 steps from neutral towards one target.

use std::time::{Duration, Instant};

use crate::control::{Controller, Observation, Target};
use crate::physics::{Command, State};
use crate::sim::{Environment, Trouble};

/// Steps of an episode (section V-E of \[GSFM26\]).
pub const STEPS: usize = 1000;

/// Steps over which the settled error is taken: the last fifth.
pub const SETTLED: usize = 200;

/// Settled error above which an episode counts as diverged, degrees (Table VIII).
pub const DIVERGED_DEG: f64 = 10.0;

/// What came of an episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Mean of roll and pitch RMSE over the last fifth, degrees; 180 if the aircraft was lost.
    pub settled_deg: f64,
    /// Time that the controller needed for each step.
    pub cost: Vec<Duration>,
}

/// An episode to fly.
pub struct Episode<'a> {
    /// Where.
    pub environment: &'a mut dyn Environment,
    /// With what.
    pub controller: &'a mut dyn Controller,
    /// Seed of the controller's own randomness.
    pub seed: u64,
}

impl Episode<'_> {
    /// Flies towards `target` and scores it; `watch` sees every step.
    ///
    /// # Errors
    /// If the environment cannot be reset. A loss on the way is an outcome, not an error.
    pub fn fly(
        self,
        target: &Target,
        mut watch: impl FnMut(&Observation, &Command),
    ) -> Result<Outcome, Trouble> {
        let mut seen = self.environment.reset()?;
        self.controller.reset(self.seed, Command::IDLE);
        let mut cost = Vec::with_capacity(STEPS);
        let (mut roll, mut pitch) = (0.0, 0.0);
        for step in 0..STEPS {
            let start = Instant::now();
            let command = self.controller.command(&seen, target);
            cost.push(start.elapsed());
            watch(&seen, &command);
            seen = match self.environment.step(command) {
                Ok(seen) => seen,
                Err(_) => return Ok(Outcome { settled_deg: 180.0, cost }),
            };
            if step >= STEPS - SETTLED {
                let [r, p] = attitude_error_deg(&seen.state, target);
                roll += r * r;
                pitch += p * p;
            }
        }
        let rmse = |sum: f64| (sum / SETTLED as f64).sqrt();
        Ok(Outcome { settled_deg: (rmse(roll) + rmse(pitch)) / 2.0, cost })
    }
}

/// Roll and pitch less their commands, degrees, the shorter way round.
pub fn attitude_error_deg(state: &State, target: &Target) -> [f64; 2] {
    let wrap = |x: f64| (x + 180.0).rem_euclid(360.0) - 180.0;
    [wrap((state.roll - target.roll).to_degrees()), wrap((state.pitch - target.pitch).to_degrees())]
}
