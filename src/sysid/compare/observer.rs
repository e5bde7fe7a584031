//! Disturbance observer of free runs: the mean error of the model's accelerations just before a run is added during the run.

use greylag_model::{GreyBox, Memory};

use super::free_run::error;
use crate::flight_path::reconstruction::Instant;
use crate::weak_form::prepared::Prepared;

/// A run uses its disturbance only if the flight holds at least this share of [`Observer::past_s`] before it.
const LEAST_PAST: f64 = 0.5;

/// A disturbance observer without inputs of its own: it knows only the flight before the start of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Time before the start of a run over which the model's error is averaged, s.
    pub past_s: f64,
    /// Time constant with which the disturbance decays during the run, s; infinite for a constant disturbance.
    pub decay_s: f64,
}

/// Disturbance of a run that starts at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disturbance {
    /// Rates that are added to those of the model, per second, in the order and units of `State::NAMES`. Those of roll and pitch
    /// angle are zero, since their equations are exact.
    rates: [f64; 8],
    /// Factor of the decay from one sample to the next.
    keep: f64,
}

impl Observer {
    /// The disturbance at sample `start` of `segment`: the mean difference of measured and predicted steps over the samples
    /// before it, divided by the sampling interval. Zero if the segment begins too shortly before `start`.
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
    /// Adds the disturbance to a predicted state over one sampling interval `dt`, s, and lets it decay.
    pub(super) fn act(&mut self, state: &mut [f64; 8], dt: f64) {
        for (x, rate) in state.iter_mut().zip(&mut self.rates) {
            *x += dt * *rate;
            *rate *= self.keep;
        }
    }
}
