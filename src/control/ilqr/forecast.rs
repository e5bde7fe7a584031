//! Comparison of the attitude that a plan predicted with the attitude that was reached.
//!
//! One-step predictions cannot show an error of the closed loop: a wrong model whose accelerations are nearly right may still make
//! plans under which the aircraft oscillates. The attitude at the end of a quarter of a second shows it.

use crate::Target;
use greylag_physics::State;

use super::course::wrapped;

/// Ticks between a prediction and its comparison.
pub(super) const SPAN: usize = 25;

/// Predicted attitudes of the last ticks.
#[derive(Clone, Debug)]
pub(super) struct Forecast {
    /// Roll and pitch (rad) that are expected at the tick of this index, modulo the span.
    expected: [Option<[f64; 2]>; SPAN],
    now: usize,
    target: Option<Target>,
}

impl Forecast {
    pub fn new() -> Forecast {
        Forecast { expected: [None; SPAN], now: 0, target: None }
    }

    /// Drops all predictions, where the plans were not flown.
    pub fn forget(&mut self) {
        self.expected = [None; SPAN];
    }

    /// The error of the prediction for this tick, rad: the larger one of roll and pitch. `None` without a prediction
    /// towards this target.
    pub fn error(&mut self, seen: &State, target: &Target) -> Option<f64> {
        if self.target != Some(*target) {
            self.forget();
            self.target = Some(*target);
        }
        self.now = (self.now + 1) % SPAN;
        let [roll, pitch] = self.expected[self.now].take()?;
        Some(wrapped(seen.roll - roll).abs().max((seen.pitch - pitch).abs()))
    }

    /// Notes the state that the plan of this tick predicts after [`SPAN`] ticks.
    pub fn note(&mut self, after: &State) {
        self.expected[self.now] = Some([after.roll, after.pitch]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(roll: f64) -> State {
        State { roll, ..State::NEUTRAL }
    }

    #[test]
    fn a_prediction_is_compared_when_its_time_has_come() {
        let target = Target { roll: 1.0, pitch: 0.0, airspeed: 20.0 };
        let mut forecast = Forecast::new();
        for tick in 0..SPAN {
            assert_eq!(forecast.error(&at(0.0), &target), None, "{tick}");
            forecast.note(&at(0.01 * tick as f64));
        }
        for tick in 0..SPAN {
            let error = forecast.error(&at(0.5), &target).unwrap();
            assert!((error - (0.5 - 0.01 * tick as f64)).abs() < 1e-12, "{tick}: {error}");
        }
        assert_eq!(forecast.error(&at(0.5), &target), None, "no plan was flown since");
    }

    #[test]
    fn predictions_towards_another_target_are_dropped() {
        let target = Target { roll: 1.0, pitch: 0.0, airspeed: 20.0 };
        let mut forecast = Forecast::new();
        for _ in 0..SPAN {
            forecast.error(&at(0.0), &target);
            forecast.note(&at(1.0));
        }
        let other = Target { roll: -1.0, ..target };
        assert_eq!(forecast.error(&at(0.0), &other), None);
    }
}
