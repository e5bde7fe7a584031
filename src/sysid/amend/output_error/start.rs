//! Beginning of the output-error fit: starting values from forces and moments, then searches with shots (short simulations) of
//! increasing length.

use super::{FitOptions, LEAST_S, NEAR, RENEWED, Search};
use crate::amend::equation_error;
use crate::amend::error::AmendError;
use crate::amend::flight::Flight;
use crate::amend::learned;
use crate::amend::parameters::{self, Free};
use crate::diagnose::search::clocks::{self, Clocks};
use crate::per_flight::{PerFlight, trims};
use crate::progress::{Progress, report};
use greylag_model::GreyBox;

/// Beginning of a search: the unknown coefficients and their starting values.
pub(super) struct Start {
    /// The model, with trim terms if trims are estimated.
    pub flown: GreyBox,
    pub free: Vec<Free>,
    /// Values of the free coefficients: estimates from forces and moments, and those of the model file.
    pub theta: Vec<f64>,
    given: Vec<f64>,
    /// Delays of the recorded actuators, if the model has added input effects.
    pub clocks: Option<Clocks>,
}

impl Start {
    /// Estimates the starting values from forces and moments. Errors as for `fit`.
    pub fn of(
        model: &GreyBox,
        flights: &[Flight],
        options: &FitOptions,
        progress: &Progress,
    ) -> Result<Start, AmendError> {
        enough(model, flights.iter())?;
        let names: Vec<&str> = flights.iter().map(|f| f.prepared.name.as_str()).collect();
        learned::distinct(&names, &options.per_flight)?;
        let added: Vec<&str> = options.added.iter().map(String::as_str).collect();
        let free = parameters::free(model, &added);
        if free.is_empty() {
            return Err(AmendError::NothingFree { model: model.name.clone() });
        }
        let doing = format!("{}: equation error over {} flight(s)", model.name, flights.len());
        report(progress, &doing, 0.0)?;
        let asked = options.per_flight;
        let clocks = match free.iter().any(|f| f.input && f.added) {
            true => delays(model, None, &free, flights.iter(), asked),
            false => None,
        };
        let theta = match &clocks {
            Some(clocks) => values(&clocks.model, &free),
            None => equation_error::start(model, &free, flights),
        };
        let given = values(model, &free);
        let flown = if asked.has_trims() { trims::joined(model)? } else { model.clone() };
        Ok(Start { flown, free, theta, given, clocks })
    }

    /// The beginning of a search near `estimates`, names and values of coefficients of a similar model. Other coefficients start at
    /// their values in `model`. `added` are the added effects of `model`.
    ///
    /// # Errors
    /// If no coefficient is free.
    pub fn near(
        model: &GreyBox,
        added: &[String],
        estimates: &[(String, f64)],
    ) -> Result<Start, AmendError> {
        let added: Vec<&str> = added.iter().map(String::as_str).collect();
        let free = parameters::free(model, &added);
        if free.is_empty() {
            return Err(AmendError::NothingFree { model: model.name.clone() });
        }
        let given = values(model, &free);
        let known = |f: &Free| estimates.iter().find(|(name, _)| *name == f.name);
        let pairs = free.iter().zip(&given);
        let theta = pairs.map(|(f, value)| known(f).map_or(*value, |(_, near)| *near)).collect();
        Ok(Start { flown: model.clone(), free, theta, given, clocks: None })
    }

    /// Searches with one length of the shots after the other. Errors as for `fit`.
    pub fn searched<'a>(
        &'a self,
        flights: &'a [Flight],
        options: &FitOptions,
        progress: &Progress,
    ) -> Result<Search<'a>, AmendError> {
        let mut search = Search::new(self, flights, options.per_flight);
        for (k, length_s) in options.lengths_s.iter().enumerate() {
            let doing = format!("{}: output error over {length_s} s", self.flown.name);
            let share = 0.9 / options.lengths_s.len() as f64;
            let from = 0.1 + share * k as f64;
            let step = |share_done: f64| report(progress, &doing, from + share * share_done);
            step(0.0)?;
            if k == 0 {
                search.start_from_the_closer(&self.given, *length_s);
            }
            search.shots_of(*length_s)?;
            // only the last length determines the result
            match k + 1 == options.lengths_s.len() {
                true => search.settle(0..options.renewals, RENEWED, &step)?,
                false => search.settle(0..options.renewals.min(2), NEAR, &step)?,
            }
        }
        Ok(search)
    }
}

/// Checks that `flights` are long enough for a fit of `model`.
pub(super) fn enough<'a>(
    model: &GreyBox,
    flights: impl Iterator<Item = &'a Flight>,
) -> Result<(), AmendError> {
    let flown_s: f64 = flights.map(Flight::seconds).sum();
    if flown_s < LEAST_S {
        let model = model.name.clone();
        return Err(AmendError::TooLittle { model, flown_s, needed_s: LEAST_S });
    }
    Ok(())
}

/// Estimates the delays of the recorded actuators from forces and moments, together with the input effects of the model.
/// Free runs cannot distinguish a delay of the record from a delay of the actuators. `near` is an estimate that is already
/// close to the result.
pub(super) fn delays<'a>(
    model: &GreyBox,
    near: Option<&GreyBox>,
    free: &[Free],
    flights: impl Iterator<Item = &'a Flight>,
    per_flight: PerFlight,
) -> Option<Clocks> {
    let given = free.iter().filter(|f| f.added).map(|f| f.index).min()?;
    let flights: Vec<_> = flights.map(|f| (&f.prepared, &f.forces)).collect();
    clocks::clocks(model, near, given, &flights, per_flight)
}

/// Values of the free coefficients in `model`, limited to their bounds.
fn values(model: &GreyBox, free: &[Free]) -> Vec<f64> {
    let of = |f: &Free| model.coefficients()[f.index].value.clamp(f.bounds.0, f.bounds.1);
    free.iter().map(of).collect()
}
