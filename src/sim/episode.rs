//! One episode of the paper's protocol: 1000 steps from neutral towards one target.

use std::time::{Duration, Instant};

use crate::{Environment, Trouble};
use greylag_control::{Controller, Observation, Target};
use greylag_model::STEP;
use greylag_physics::Command;

/// Steps of an episode (section V-E of \[GSFM26\]).
pub const STEPS: usize = 1000;

/// Steps over which the settled error is taken: the last fifth.
pub const SETTLED: usize = 200;

/// Settled error above which an episode counts as diverged, degrees (Table VIII).
pub const DIVERGED_DEG: f64 = 10.0;

/// Attitude error within which a target counts as reached, degrees.
pub const REACHED_DEG: f64 = 1.0;

/// What came of an episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Mean of roll and pitch RMSE over the last fifth, degrees; 180 if the aircraft was lost.
    pub settled_deg: f64,
    /// Time after which roll and pitch stay within [`REACHED_DEG`] of the target, s; the whole episode's
    /// if they never do.
    pub settling_s: f64,
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
        self.controller.reset(self.seed);
        let mut cost = Vec::with_capacity(STEPS);
        let mut errors = Vec::with_capacity(SETTLED);
        let mut away = 0;
        for step in 0..STEPS {
            let start = Instant::now();
            let command = self.controller.command(&seen, target);
            cost.push(start.elapsed());
            watch(&seen, &command);
            seen = match self.environment.step(command) {
                Ok(seen) => seen,
                Err(_) => {
                    return Ok(Outcome { settled_deg: 180.0, settling_s: seconds(STEPS), cost });
                }
            };
            let error = attitude_error_deg([seen.state.roll, seen.state.pitch], target);
            if !error.iter().all(|e| e.abs() <= REACHED_DEG) {
                away = step + 1;
            }
            if step >= STEPS - SETTLED {
                errors.push(error);
            }
        }
        Ok(Outcome { settled_deg: settled_error_deg(&errors), settling_s: seconds(away), cost })
    }
}

fn seconds(steps: usize) -> f64 {
    steps as f64 * STEP
}

/// The settled error of \[GSFM26\] section V-E: the mean of roll and pitch RMSE, degrees, of
/// attitude errors (roll, pitch) in degrees; NaN for none.
pub fn settled_error_deg(errors: &[[f64; 2]]) -> f64 {
    let rmse = |axis: usize| {
        let squares: f64 = errors.iter().map(|e| e[axis] * e[axis]).sum();
        (squares / errors.len() as f64).sqrt()
    };
    (rmse(0) + rmse(1)) / 2.0
}

/// Roll and pitch (rad) less their commands, degrees, the shorter way round.
pub fn attitude_error_deg([roll, pitch]: [f64; 2], target: &Target) -> [f64; 2] {
    let wrap = |x: f64| (x + 180.0).rem_euclid(360.0) - 180.0;
    [wrap((roll - target.roll).to_degrees()), wrap((pitch - target.pitch).to_degrees())]
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::{ActuatorState, State, Time};

    const TARGET: Target = Target { roll: 0.0, pitch: 0.0, airspeed: 16.67 };

    /// Off by a given attitude in the last fifth, or lost at a step.
    struct Fake {
        step: usize,
        settled: [f64; 2],
        lost_at: usize,
    }

    impl Fake {
        fn see(&self) -> Observation {
            let settled = self.step > STEPS - SETTLED;
            let [roll, pitch] = if settled { self.settled.map(f64::to_radians) } else { [1.0; 2] };
            Observation {
                time: Time::default(),
                state: State { roll, pitch, ..State::NEUTRAL },
                actuators: ActuatorState::default(),
                altitude: 600.0,
                previous: [Command::IDLE; 2],
            }
        }
    }

    impl Environment for Fake {
        fn reset(&mut self) -> Result<Observation, Trouble> {
            self.step = 0;
            Ok(self.see())
        }
        fn step(&mut self, _: Command) -> Result<Observation, Trouble> {
            self.step += 1;
            if self.step == self.lost_at { Err(Trouble::Command) } else { Ok(self.see()) }
        }
    }

    #[derive(Clone)]
    struct Idle;

    impl Controller for Idle {
        fn name(&self) -> &'static str {
            "idle"
        }
        fn reset(&mut self, _: u64) {}
        fn command(&mut self, _: &Observation, _: &Target) -> Command {
            Command::IDLE
        }
        fn boxed_clone(&self) -> Box<dyn Controller> {
            Box::new(self.clone())
        }
    }

    fn settled(settled: [f64; 2], lost_at: usize) -> f64 {
        let mut environment = Fake { step: 0, settled, lost_at };
        let episode = Episode { environment: &mut environment, controller: &mut Idle, seed: 0 };
        episode.fly(&TARGET, |_, _| ()).unwrap().settled_deg
    }

    #[test]
    fn only_the_last_fifth_counts_and_roll_and_pitch_are_averaged() {
        assert!((settled([3.0, -1.0], usize::MAX) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn angles_are_compared_the_shorter_way_round() {
        assert!((settled([359.0, 0.0], usize::MAX) - 0.5).abs() < 1e-9);
    }

    #[test]
    fn the_time_to_settle_ends_with_the_last_step_away() {
        let mut environment = Fake { step: 0, settled: [0.5, -0.5], lost_at: usize::MAX };
        let episode = Episode { environment: &mut environment, controller: &mut Idle, seed: 0 };
        let outcome = episode.fly(&TARGET, |_, _| ()).unwrap();
        assert!((outcome.settling_s - seconds(STEPS - SETTLED)).abs() < 1e-9);
    }

    #[test]
    fn a_lost_aircraft_is_off_by_180_degrees_even_at_the_last_step() {
        assert_eq!(settled([0.0; 2], STEPS), 180.0);
        const { assert!(180.0 > DIVERGED_DEG) };
    }
}
