//! Comparison of the attitude that a plan predicted with the attitude that is reached. A tick is a control cycle of 10 ms.
//!
//! One-step predictions do not show an error of the closed loop: a model whose accelerations are nearly right may still give
//! plans under which the aircraft oscillates. A comparison after a quarter of a second shows the oscillation.

use crate::Target;
use greylag_physics::State;

use super::course::wrapped;

/// Ticks between a prediction and its comparison.
pub(super) const SPAN: usize = 25;

/// Attitude that a plan predicted, and the target of this plan: roll and pitch, rad.
#[derive(Clone, Copy, Debug)]
struct Prediction {
    attitude: [f64; 2],
    target: [f64; 2],
}

/// Predictions made in the last [`SPAN`] ticks.
#[derive(Clone, Debug)]
pub(super) struct Forecast {
    /// The prediction for each tick, at the tick's number modulo [`SPAN`].
    expected: [Option<Prediction>; SPAN],
    now: usize,
}

impl Forecast {
    pub fn new() -> Forecast {
        Forecast { expected: [None; SPAN], now: 0 }
    }

    /// Drops all predictions. They are void if their plans are not flown.
    pub fn forget(&mut self) {
        self.expected = [None; SPAN];
    }

    /// Advances to the next tick. Compares the attitude in `seen` with the prediction for this tick and returns the larger of
    /// the errors in roll and pitch, rad. Each error is reduced by the change of the target since the prediction. `None` if
    /// there is no prediction for this tick.
    pub fn error(&mut self, seen: &State, target: &Target) -> Option<f64> {
        self.now = (self.now + 1) % SPAN;
        let then = self.expected[self.now].take()?;
        let (now, target) = ([seen.roll, seen.pitch], [target.roll, target.pitch]);
        let of = |axis: usize| {
            let moved = wrapped(target[axis] - then.target[axis]).abs();
            wrapped(now[axis] - then.attitude[axis]).abs() - moved
        };
        Some(of(0).max(of(1)))
    }

    /// Stores the attitude that the plan of this tick predicts after [`SPAN`] ticks.
    pub fn note(&mut self, after: &State, target: &Target) {
        self.expected[self.now] = Some(Prediction {
            attitude: [after.roll, after.pitch],
            target: [target.roll, target.pitch],
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TARGET: Target = Target { roll: 1.0, pitch: 0.0, airspeed: 20.0 };

    fn at(roll: f64) -> State {
        State { roll, ..State::NEUTRAL }
    }

    #[test]
    fn a_prediction_is_compared_when_its_time_has_come() {
        let mut forecast = Forecast::new();
        for tick in 0..SPAN {
            assert_eq!(forecast.error(&at(0.0), &TARGET), None, "{tick}");
            forecast.note(&at(0.01 * tick as f64), &TARGET);
        }
        for tick in 0..SPAN {
            let error = forecast.error(&at(0.5), &TARGET).unwrap();
            assert!((error - (0.5 - 0.01 * tick as f64)).abs() < 1e-12, "{tick}: {error}");
        }
        assert_eq!(forecast.error(&at(0.5), &TARGET), None, "no plan was flown since");
    }

    #[test]
    fn what_the_target_has_moved_is_no_error() {
        let mut forecast = Forecast::new();
        for _ in 0..SPAN {
            forecast.error(&at(0.0), &TARGET);
            forecast.note(&at(0.0), &TARGET);
        }
        // a client that moves its setpoint at every tick does not disable the comparison
        let moved = Target { roll: 1.1, ..TARGET };
        let error = forecast.error(&at(0.4), &moved).unwrap();
        assert!((error - 0.3).abs() < 1e-12, "{error}");
        let jumped = Target { roll: -1.0, ..TARGET };
        assert_eq!(forecast.error(&at(-0.4), &jumped), Some(0.0), "pitch was predicted exactly");
    }
}
