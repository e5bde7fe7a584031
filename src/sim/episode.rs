//! One episode of the protocol of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`): 1000 steps from level flight at 16.67
//! m/s to one target.

use std::time::{Duration, Instant};

use crate::{Environment, Trouble};
use greylag_control::quality::{Moment, Track};
use greylag_control::{Controller, Observation, Target};
use greylag_model::STEP;
use greylag_physics::Command;

pub use greylag_control::quality::{REACHED_DEG, attitude_error_deg};

/// Number of steps of an episode: 10 s in steps of 10 ms (section V-E of \[GSFM26\]).
pub const STEPS: usize = 1000;

/// Number of steps at the end of an episode from which the settled error is computed: the last fifth.
pub const SETTLED: usize = 200;

/// Settled error above which an episode counts as diverged, degrees (Table VIII of \[GSFM26\]).
pub const DIVERGED_DEG: f64 = 10.0;

/// Result of an episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Settled error: mean of roll and pitch RMSE over the last fifth, degrees; 180 if the aircraft was lost.
    pub settled_deg: f64,
    /// Time after which roll and pitch stay within [`REACHED_DEG`] of the target, s. It is the whole duration if they do not
    /// stay there, or if the aircraft was lost.
    pub settling_s: f64,
    /// Computing time of the controller for each scored step.
    pub cost: Vec<Duration>,
    /// Measurements and commands of the scored leg.
    pub track: Track,
}

/// Conditions of an episode.
pub struct Episode<'a> {
    /// The environment to fly in.
    pub environment: &'a mut dyn Environment,
    /// The controller that flies.
    pub controller: &'a mut dyn Controller,
    /// Seed of the controller's random numbers.
    pub seed: u64,
}

/// A commanded target and its duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Attitude and airspeed target.
    pub target: Target,
    /// Duration in steps of 10 ms.
    pub steps: usize,
}

impl Episode<'_> {
    /// Flies towards `target` and scores the flight. `watch` is called at every step.
    ///
    /// # Errors
    ///
    /// If the environment cannot be reset. Losing the aircraft is a result, not an error.
    pub fn fly(
        self,
        target: &Target,
        watch: impl FnMut(&Observation, &Command),
    ) -> Result<Outcome, Trouble> {
        self.fly_leg(None, Leg { target: *target, steps: STEPS }, watch)
    }

    /// Flies `leg` and scores it. The leg starts at the end of the leg `first`, which is not scored, or at the reset state if
    /// `first` is `None`. `watch` is called at every step of both legs.
    ///
    /// # Errors
    ///
    /// The same as [`fly`](Episode::fly).
    pub fn fly_leg(
        self,
        first: Option<Leg>,
        leg: Leg,
        mut watch: impl FnMut(&Observation, &Command),
    ) -> Result<Outcome, Trouble> {
        let Episode { environment, controller, seed } = self;
        let mut seen = environment.reset()?;
        controller.reset(seed);
        let (mut cost, mut before) = (Vec::with_capacity(leg.steps), None);
        let mut moments = Vec::with_capacity(leg.steps + 1);
        let target = leg.target;
        let flown = first.into_iter().map(|first| (first, false)).chain([(leg, true)]);
        for (Leg { target: wanted, steps }, scored) in flown {
            for step in 0..steps {
                let start = Instant::now();
                let command = controller.command(&seen, &wanted);
                let took = start.elapsed();
                watch(&seen, &command);
                if scored {
                    cost.push(took);
                    moments.push(Moment::new(&seen, environment.load_factor(), &command.clamped()));
                } else {
                    before = Some(command.clamped());
                }
                seen = match environment.step(command) {
                    Ok(seen) => seen,
                    Err(_) => {
                        let lost_s = seconds(if scored { steps - step } else { leg.steps });
                        return Ok(Outcome::lost(
                            Track { moments, target, before, lost_s },
                            leg,
                            cost,
                        ));
                    }
                };
            }
        }
        moments.push(Moment::new(&seen, environment.load_factor(), &seen.previous[0]));
        Ok(Outcome::flown(Track { moments, target, before, lost_s: 0.0 }, cost))
    }
}

impl Outcome {
    fn lost(track: Track, leg: Leg, cost: Vec<Duration>) -> Outcome {
        Outcome { settled_deg: 180.0, settling_s: seconds(leg.steps), cost, track }
    }

    fn flown(track: Track, cost: Vec<Duration>) -> Outcome {
        // the first sample precedes the first step and is not scored
        let errors: Vec<[f64; 2]> = track.moments[1..]
            .iter()
            .map(|m| attitude_error_deg(m.attitude, &track.target))
            .collect();
        let last = errors.len() - errors.len() * SETTLED / STEPS;
        let away = errors.iter().rposition(|e| !e.iter().all(|e| e.abs() <= REACHED_DEG));
        Outcome {
            settled_deg: settled_error_deg(&errors[last..]),
            settling_s: seconds(away.map_or(0, |step| step + 1)),
            cost,
            track,
        }
    }
}

fn seconds(steps: usize) -> f64 {
    steps as f64 * STEP
}

/// The settled error of \[GSFM26\] section V-E, degrees: the mean of the RMSE in roll and the RMSE in pitch. `errors`
/// are pairs of roll and pitch error, degrees. The result is NaN if `errors` is empty.
pub fn settled_error_deg(errors: &[[f64; 2]]) -> f64 {
    let rmse = |axis: usize| {
        let squares: f64 = errors.iter().map(|e| e[axis] * e[axis]).sum();
        (squares / errors.len() as f64).sqrt()
    };
    (rmse(0) + rmse(1)) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::{ActuatorState, State, Time};

    const TARGET: Target = Target { roll: 0.0, pitch: 0.0, airspeed: 16.67 };

    /// An environment in which the aircraft has the attitude `settled` (degrees) in the last fifth and is lost at step
    /// `lost_at`.
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
                incidence_sd: [0.0; 2],
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
        fn load_factor(&self) -> f64 {
            1.0
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

    /// A leg starts at the end of the first leg. Its track and computing time exclude the first leg.
    #[test]
    fn a_leg_is_scored_from_where_the_first_one_ends() {
        let mut environment = Fake { step: 0, settled: [0.5, -0.5], lost_at: usize::MAX };
        let episode = Episode { environment: &mut environment, controller: &mut Idle, seed: 0 };
        let first = Leg { target: Target { roll: 1.0, ..TARGET }, steps: 500 };
        let leg = Leg { target: TARGET, steps: 400 };
        let mut steps = 0;
        let outcome = episode.fly_leg(Some(first), leg, |_, _| steps += 1).unwrap();
        assert_eq!((steps, outcome.cost.len(), outcome.track.moments.len()), (900, 400, 401));
        assert_eq!((outcome.track.target, outcome.track.before), (TARGET, Some(Command::IDLE)));
        // off target up to step 800 of the episode, which is step 300 of the leg
        assert!(
            (outcome.settling_s - 3.0).abs() < 1e-9 && (outcome.settled_deg - 0.5).abs() < 1e-9
        );
        let mut environment = Fake { step: 0, settled: [0.0; 2], lost_at: 200 };
        let episode = Episode { environment: &mut environment, controller: &mut Idle, seed: 0 };
        let lost = episode.fly_leg(Some(first), leg, |_, _| ()).unwrap();
        assert!((lost.track.lost_s - 4.0).abs() < 1e-9 && lost.settled_deg == 180.0);
    }

    #[test]
    fn a_lost_aircraft_is_off_by_180_degrees_even_at_the_last_step() {
        assert_eq!(settled([0.0; 2], STEPS), 180.0);
        const { assert!(180.0 > DIVERGED_DEG) };
    }
}
