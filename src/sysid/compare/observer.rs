//! Disturbance estimate for free runs (open-loop simulations): the mean difference between the measured rates of the states
//! and the model's, just before a run. It is added to the model's rates during the run, and decays.

use greylag_model::{GreyBox, Memory};

use super::free_run::error;
use crate::flight_path::reconstruction::Instant;
use crate::weak_form::prepared::Prepared;

/// Smallest fraction of [`Observer::past_s`] that must be recorded before the start of a run. With less, the disturbance is
/// zero.
const LEAST_PAST: f64 = 0.5;

/// A disturbance observer that estimates the disturbance once, from the flight before the start of a run. It uses no
/// measurements during the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Length of the interval before the start of a run over which the model's error is averaged, s.
    pub past_s: f64,
    /// Time constant with which the disturbance decays during the run, s; infinite for a constant disturbance.
    pub decay_s: f64,
}

/// Disturbance during one run, estimated from the samples before its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disturbance {
    /// Rates that are added to those of the model, per second, in the order and units of `State::NAMES`. Those of roll and pitch
    /// angle are zero, since their equations are exact.
    rates: [f64; 8],
    /// Factor of the decay from one sample to the next.
    keep: f64,
}

impl Observer {
    /// Estimates the disturbance for a run from sample `start` of `segment`: mean of the measured minus the predicted steps over
    /// the samples before it, divided by the sampling interval. It is zero if too few samples precede `start`.
    pub(super) fn before(
        &self,
        model: &GreyBox,
        flight: &Prepared,
        segment: &[Instant],
        start: usize,
    ) -> Disturbance {
        let wanted = ((self.past_s / flight.dt).round() as usize).max(1);
        let steps = wanted.min(start);
        let keep = (-flight.dt / self.decay_s).exp();
        if (steps as f64) < LEAST_PAST * wanted as f64 {
            return Disturbance { rates: [0.0; 8], keep };
        }
        let mut memory = Memory::default();
        let mut rates = [0.0; 8];
        for k in start - steps..start {
            let next = flight.advance(
                model,
                segment[k].state,
                [&segment[k], &segment[k + 1]],
                &mut memory,
            );
            let missed = error(&next.to_array(), &segment[k + 1].state.to_array());
            rates.iter_mut().zip(missed).for_each(|(sum, x)| *sum += x);
        }
        let time = steps as f64 * flight.dt;
        rates = rates.map(|sum| if sum.is_finite() { sum / time } else { 0.0 });
        rates[..2].fill(0.0);
        Disturbance { rates, keep }
    }
}

impl Disturbance {
    /// Adds the disturbance of one sampling interval `dt` (s) to a predicted state. Then reduces the disturbance by its decay.
    pub(super) fn act(&mut self, state: &mut [f64; 8], dt: f64) {
        for (x, rate) in state.iter_mut().zip(&mut self.rates) {
            *x += dt * *rate;
            *rate *= self.keep;
        }
    }
}
