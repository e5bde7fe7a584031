//! Corrections of free runs. A correction is an additional term in the model's rates. It is a disturbance that an observer
//! estimated before the run, a linear function of states and deflections (a linear residual), or a pull towards the start.

use greylag_model::{GreyBox, Memory};

use super::arx::{self, Arx};
use super::free_run::{self, error};
use super::result::HorizonScore;
use crate::flight_path::reconstruction::{Instant, Reconstruction};
use crate::weak_form::prepared::{ClockError, Prepared};

/// Smallest fraction of [`Observer::past_s`] that must be recorded before the start of a run. With less, the disturbance is
/// zero.
const LEAST_PAST: f64 = 0.5;

/// A disturbance observer that estimates the disturbance once, from the flight before the start of a run. During the run it
/// uses no measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Length of the interval before the start of a run over which the model's error is averaged, s.
    pub past_s: f64,
    /// Time constant with which the disturbance decays during the run, s; infinite for a constant disturbance.
    pub decay_s: f64,
}

/// A pull of attitude and airspeed towards the state at the start of a run, as of a controller that holds them: −(x − x₀)/τ is
/// added to their rates. Slow errors of the model then do not grow with the integration; fast motion is hardly changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    /// Time constant τ for roll and pitch angle, s; infinite for no pull.
    pub attitude_s: f64,
    /// Time constant τ for the airspeed, s; infinite for no pull.
    pub airspeed_s: f64,
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
    fn before(
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

/// A correction of the free runs of a model.
#[derive(Clone, Copy, Debug)]
pub enum Correction<'a> {
    /// A disturbance, estimated before each run.
    Observer(Observer),
    /// A linear residual from [`Arx::of_residual`].
    Linear(&'a Arx),
    /// A pull towards the start of each run.
    Pull(Pull),
}

/// A [`Correction`] during one run.
pub(super) enum Acting<'a> {
    Disturbance(Disturbance),
    Linear {
        arx: &'a Arx,
        /// Predicted and, before the start of the run, measured states, the newest first.
        past: Vec<[f64; 8]>,
    },
    Pull {
        pull: Pull,
        /// The state at the start of the run.
        from: [f64; 8],
    },
}

/// Free-run errors of `model` over `flights`, one for each of `horizons_s` (s), with its rates corrected by `correction`.
///
/// # Errors
/// The sampling interval of a flight is not usable: see `ClockError`.
pub fn scores(
    model: &GreyBox,
    flights: &[Reconstruction],
    horizons_s: &[f64],
    correction: Option<Correction>,
) -> Result<Vec<HorizonScore>, ClockError> {
    let slowest = model.airframe.envelope.flying_from_mps();
    let prepared =
        flights.iter().map(|f| Prepared::new(f, slowest)).collect::<Result<Vec<_>, _>>()?;
    let (runs, _) = free_run::fly_with(model, &prepared, horizons_s, correction);
    Ok(horizons_s.iter().map(|h| runs.score(*h)).collect())
}

impl<'a> Correction<'a> {
    /// The correction of a run of `model` that starts at sample `start` of `segment`.
    pub(super) fn from(
        &self,
        model: &GreyBox,
        flight: &Prepared,
        segment: &[Instant],
        start: usize,
    ) -> Acting<'a> {
        match *self {
            Correction::Observer(observer) => {
                Acting::Disturbance(observer.before(model, flight, segment, start))
            }
            Correction::Linear(arx) => {
                Acting::Linear { arx, past: arx::past(segment, start, arx.order()) }
            }
            Correction::Pull(pull) => Acting::Pull { pull, from: segment[start].state.to_array() },
        }
    }
}

impl Acting<'_> {
    /// Corrects `next`, the state that the model predicts one sampling interval `dt` (s) after the last sample of `flown`.
    pub(super) fn act(&mut self, next: &mut [f64; 8], flown: &[Instant], dt: f64) {
        match self {
            Acting::Disturbance(disturbance) => disturbance.act(next, dt),
            Acting::Pull { pull, from } => pull.act(next, from, dt),
            Acting::Linear { arx, past } => {
                let rates = arx.rates(past, flown);
                next.iter_mut().zip(rates.iter()).for_each(|(x, rate)| *x += dt * rate);
                past.rotate_right(1);
                past[0] = *next;
                // roll is continuous over ±180°
                past.iter_mut().for_each(|state| state[0] = next[0] + error(next, state)[0]);
            }
        }
    }
}

impl Pull {
    /// Pulls a predicted state towards the state `from` over one sampling interval `dt`, s.
    fn act(&self, state: &mut [f64; 8], from: &[f64; 8], dt: f64) {
        let away = error(from, state);
        for (k, tau_s) in
            [self.attitude_s, self.attitude_s, self.airspeed_s].into_iter().enumerate()
        {
            state[k] += away[k] * (-dt / tau_s).exp_m1();
        }
    }
}

impl Disturbance {
    /// Adds the disturbance to a predicted state over one sampling interval `dt`, s, and lets it decay.
    fn act(&mut self, state: &mut [f64; 8], dt: f64) {
        for (x, rate) in state.iter_mut().zip(&mut self.rates) {
            *x += dt * *rate;
            *rate *= self.keep;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pull_lets_a_departure_decay_with_its_time_constant() {
        let pull = Pull { attitude_s: 2.0, airspeed_s: f64::INFINITY };
        // a roll of 179° and one of −179° are 2° apart
        let mut from = [0.0; 8];
        from[0] = 179_f64.to_radians();
        let mut state = [0.1; 8];
        state[0] = -179_f64.to_radians();
        for _ in 0..200 {
            pull.act(&mut state, &from, 0.01);
        }
        let left = (-1.0_f64).exp();
        assert!((error(&from, &state)[0] - 2_f64.to_radians() * left).abs() < 1e-9, "{state:?}");
        assert!((state[1] - 0.1 * left).abs() < 1e-12 && state[2..] == [0.1; 6], "{state:?}");
    }
}
