//! What the model leaves unexplained of the aircraft's motion, taken as constant over a plan.
//!
//! Offset-free model predictive control (Pannocchia and Rawlings, AIChE J. 49, 2003) with the
//! disturbance on the states: where the aircraft stands still the planner's model does so too, whatever is
//! wrong with it.

use crate::control::Observation;
use crate::model::{GreyBox, Memory, STEP};
use crate::physics::State;
use crate::physics::actuators::Actuators;

/// No disturbance.
pub(crate) const NONE: State =
    State { roll: 0.0, pitch: 0.0, airspeed: 0.0, p: 0.0, q: 0.0, r: 0.0, alpha: 0.0, beta: 0.0 };

/// Time constant of the estimate where nothing else is asked for, s: faster follows the noise, slower the manoeuvre.
pub(crate) const TIME_CONSTANT_S: f64 = 0.3;
/// Part of the motion that predictions may miss for the model to be planned with, where nothing else is asked for. On
/// `params/x8/learned` they never miss so much, on `prior-as-printed` almost always (`docs/validation/learned-models.md`).
pub(crate) const TRUST: f64 = 0.5;
/// Time over which predictions are compared with what happened, s: a few responses of the short period.
const MEMORY_S: f64 = 0.5;
/// Accelerations below which nothing is compared, in x_c a second: calm flight shows no model to be wrong.
const CALM: f64 = 0.02;

/// Its estimate.
#[derive(Clone, Debug)]
pub(crate) struct Disturbance {
    /// Time constant of the estimate, s.
    time_constant: f64,
    last: Option<Observation>,
    memory: Memory,
    rate: State,
    /// Mean squares over [`MEMORY_S`] of what the predictions missed and of what happened, x_c a second.
    missed: f64,
    happened: f64,
}

impl Disturbance {
    /// None yet; the estimate follows with `time_constant` (s).
    pub fn new(time_constant: f64) -> Disturbance {
        let (missed, happened) = (0.0, 0.0);
        let memory = Memory::default();
        Disturbance { time_constant, last: None, memory, rate: NONE, missed, happened }
    }

    /// Compares what is seen with what the model expected a tick ago. A gap between ticks is no
    /// evidence, neither is a number that is lost.
    pub fn update(&mut self, model: &GreyBox, seen: &Observation) {
        let follows = |last: &Observation| {
            let gap = seen.time.since(last.time).as_secs_f64();
            (gap - STEP).abs() < 0.1 * STEP
        };
        let last = self.last.replace(*seen).filter(follows);
        let Some(last) = last else {
            self.memory = Memory::default();
            return;
        };
        let figures = &model.airframe.actuators;
        let controls =
            Actuators::from_observed(&last.actuators, &last.previous, figures).controls();
        let expected = model.step(&last.state, &controls, last.altitude, &mut self.memory);
        let mut error = seen.state.advance(&expected, -1.0);
        error.roll = (error.roll + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
            - std::f64::consts::PI;
        let step = seen.state.advance(&last.state, -1.0);
        self.compare(model, &error.advance(&self.rate, -STEP), &step);
        // e is what one step added beside the model: its rate is e / STEP
        let part = STEP / self.time_constant;
        let moved = self.rate.advance(&self.rate, -part).advance(&error, part / STEP);
        if moved.is_finite() {
            self.rate = moved;
        } else {
            self.memory = Memory::default();
        }
    }

    /// Notes what a prediction missed, and what happened, in a step.
    fn compare(&mut self, model: &GreyBox, missed: &State, happened: &State) {
        let size = |change: &State| -> f64 {
            // rates and flow angles: attitude and airspeed only follow
            let scaled = change.to_array().into_iter().zip(model.scale()).skip(3);
            scaled.map(|(x, scale)| (x / scale / STEP).powi(2)).sum()
        };
        let part = STEP / MEMORY_S;
        let (missed, happened) = (size(missed), size(happened));
        if missed.is_finite() && happened.is_finite() {
            self.missed += part * (missed - self.missed);
            self.happened += part * (happened - self.happened);
        }
    }

    /// What the predictions of the last half second missed, as a part of what happened (root mean squares).
    pub fn missed_part(&self) -> f64 {
        (self.missed / (self.happened + CALM * CALM)).sqrt()
    }

    /// What the state's rate has beside the model's, per second.
    pub fn rate(&self) -> State {
        self.rate
    }

    /// What the integrator remembers of the step that led here.
    pub fn memory(&self) -> Memory {
        self.memory
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::{ActuatorState, Command, Time};
    use std::path::Path;
    use std::time::Duration;

    /// A moment that the model lacks is found, and nothing else.
    #[test]
    fn a_constant_rate_is_found() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/prior.toml");
        let model = GreyBox::load(&path).unwrap();
        let mut disturbance = Disturbance::new(0.2);
        let hidden = State { q: 0.3, ..NONE };
        let mut seen = Observation {
            time: Time::default(),
            state: State::NEUTRAL,
            actuators: ActuatorState::default(),
            altitude: 600.0,
            previous: [Command::IDLE; 2],
        };
        let mut memory = Memory::default();
        for _ in 0..100 {
            disturbance.update(&model, &seen);
            let controls = seen.actuators.controls();
            let next = model.step(&seen.state, &controls, seen.altitude, &mut memory);
            seen.state = next.advance(&hidden, STEP);
            seen.time = seen.time.plus(Duration::from_secs_f64(STEP));
        }
        let found = disturbance.rate();
        // five time constants: 0.7 % are missing
        assert!((found.q - 0.3).abs() < 0.005, "{found:?}");
        let others = State { q: 0.0, ..found };
        assert!(others.to_array().iter().all(|x| x.abs() < 1e-9), "{found:?}");
        // after a gap nothing is learned from what happened meanwhile
        seen.time = seen.time.plus(Duration::from_secs(1));
        seen.state.q += 5.0;
        disturbance.update(&model, &seen);
        assert_eq!(disturbance.rate(), found);
    }
}
