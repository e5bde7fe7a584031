//! Fits without one flight after the other, for cross-validation.

use std::sync::Arc;

use rayon::prelude::*;

use super::start::{Start, delays, enough};
use super::{DAMPING, Fit, FitOptions, RENEWED, Search, fit};
use crate::amend::error::AmendError;
use crate::amend::flight::Flight;
use crate::amend::normal::Place;
use crate::amend::shooting::Shot;
use crate::progress::ignore_progress;
use greylag_model::GreyBox;

/// Fits `model` to `flights` without one of them, once for each of the indices `left`.
///
/// All flights are fitted once. A fit without a flight starts from this fit: from its estimates, from its division into shots,
/// and from the derivatives of the other flights. The first step needs no simulation, because it solves the normal equations of
/// the other flights. All weights, errors of initial states, constants of flights and expected delays of actuators are
/// estimated again without the flight, and the search converges with new derivatives, as every other fit.
///
/// The flight has influence in two ways. The search ends in the minimum that is the nearest to the fit to all flights. The
/// parts of flights that are left out because simulations diverge there are those of the fit to all flights. If the fit to all
/// flights or the one without a flight fails, the latter is made from the beginning.
pub fn without_each(
    model: &GreyBox,
    flights: &[Flight],
    options: &FitOptions,
    left: &[usize],
) -> Vec<Result<Fit, AmendError>> {
    let start = Start::of(model, flights, options, &ignore_progress);
    let whole = start.as_ref().ok().and_then(|start| {
        let search = start.searched(flights, options, &ignore_progress).ok()?;
        Some((start, search))
    });
    let one = |left: &usize| match &whole {
        Some((start, whole)) => {
            let fold = whole.without(*left).refitted(model, start, options);
            fold.or_else(|_| without(model, flights, options, *left))
        }
        None => without(model, flights, options, *left),
    };
    left.par_iter().map(one).collect()
}

/// Does the same as [`without_each`], but makes each fit from the beginning. Coefficients without a prior can have several
/// minima. The nearest one to the fit to all flights would then know the flight that is left out.
pub fn without_each_anew(
    model: &GreyBox,
    flights: &[Flight],
    options: &FitOptions,
    left: &[usize],
) -> Vec<Result<Fit, AmendError>> {
    left.par_iter().map(|left| without(model, flights, options, *left)).collect()
}

/// Fits `model` to `flights` without the one with the index `left`, from the beginning.
fn without(
    model: &GreyBox,
    flights: &[Flight],
    options: &FitOptions,
    left: usize,
) -> Result<Fit, AmendError> {
    let others = flights.iter().enumerate().filter(|(k, _)| *k != left);
    let others: Vec<Flight> = others.map(|(_, flight)| flight.clone()).collect();
    fit(model, &others, options, &ignore_progress)
}

impl<'a> Search<'a> {
    /// The search without the flight with the index `left`, at the present estimates.
    fn without(&self, left: usize) -> Search<'a> {
        let kept: Vec<usize> =
            (0..self.shots.len()).filter(|k| self.shots[*k].flight != left).collect();
        let shot = |k: &usize| {
            let shot = self.shots[*k].clone();
            Shot { flight: shot.flight - usize::from(shot.flight > left), ..shot }
        };
        let starts = kept.iter().map(|k| self.place.starts[*k]).collect();
        let Place { theta, own, .. } = &self.place;
        let mut fold = Search {
            base: self.base,
            asked: self.asked,
            flights: self.flights.clone(),
            free: self.free.clone(),
            shots: kept.iter().map(shot).collect(),
            derivatives: kept.iter().map(|k| Arc::clone(&self.derivatives[*k])).collect(),
            short: self.short,
            place: Place { theta: theta.clone(), own: own.clone(), starts },
            residuals: kept.iter().map(|k| self.residuals[*k].clone()).collect(),
            expected: self.expected.clone(),
            weights: self.weights,
            iterations: 0,
            change: (f64::INFINITY, 0),
            stuck: false,
        };
        fold.flights.remove(left);
        fold.place.own.remove(left);
        fold.expected.remove(left);
        fold
    }

    /// The fit to the flights of this search, which is at the estimates of a fit to one flight more. `start` is the beginning
    /// of that fit, `given` the model before it.
    fn refitted(
        mut self,
        given: &GreyBox,
        start: &Start,
        options: &FitOptions,
    ) -> Result<Fit, AmendError> {
        let flights = || self.flights.iter().copied();
        enough(given, flights())?;
        if let Some(near) = &start.clocks {
            let asked = options.per_flight;
            let found = delays(given, Some(&near.model), &self.free, flights(), asked);
            let late = found.map(|found| found.late);
            self.expected = self.flights.iter().map(|f| f.doubt).collect();
            self.expect_delays(&late.unwrap_or_default());
        }
        self.reweigh();
        self.approach(0, &mut { DAMPING }, &|| Ok(()))?;
        // the derivatives of the fit to all flights count as the first ones
        self.settle(1..options.renewals, RENEWED, &|_| Ok(()))?;
        self.completed(given, options, &ignore_progress)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::amend::judge::{Judge, judged};
    use crate::amend::sample;
    use greylag_num::stream::stream;
    use greylag_physics::State;
    use rand_distr::{Distribution, StandardNormal};

    /// Standard deviations of the noise of recorded states, in the units of the state.
    const NOISE: [f64; 8] = [2e-3, 2e-3, 0.05, 5e-3, 5e-3, 5e-3, 2e-3, 2e-3];

    /// A flight of 12 s with noise. The roll damping differs between the flights by more than the noise explains.
    fn flown(model: &GreyBox, number: u32) -> Flight {
        let mut flown = model.clone();
        let of = |name: &str| model.coefficients().iter().find(|c| c.name == name).unwrap().value;
        let damping = 1.1 + 0.03 * (f64::from(number) - 1.5);
        flown.set_coefficient("roll_linear.Clp", damping * of("roll_linear.Clp"));
        flown.set_coefficient("pitch_linear.Cmq", 0.9 * of("pitch_linear.Cmq"));
        let mut flight =
            sample::flight(&flown, &format!("{number}"), 1200, 3.0 * f64::from(number));
        (flight.noise, flight.left) = (NOISE, NOISE);
        let mut random = stream(u64::from(number), &[]);
        let mut unit = || -> f64 { StandardNormal.sample(&mut random) };
        for at in &mut flight.segments[0].instants {
            let state = at.state.to_array();
            at.state = State::from_array(std::array::from_fn(|i| state[i] + NOISE[i] * unit()));
        }
        Flight::new(&flight, 8.0).unwrap()
    }

    #[test]
    fn a_fit_without_a_flight_predicts_it_like_one_from_the_beginning() {
        let model = sample::model();
        let flights: Vec<Flight> = (0..4).map(|number| flown(&model, number)).collect();
        let options = FitOptions::default();
        let all = without_each(&model, &flights, &options, &[0, 1, 2, 3]);
        for (left, found) in all.into_iter().enumerate() {
            let exact = without(&model, &flights, &options, left).unwrap();
            let judge = Judge { test: &flights[left..=left], horizons_s: &[2.0] };
            let error = |fit: &Fit| judged(&judge.scores(&fit.model)).unwrap();
            let (found, exact) = (error(&found.unwrap()), error(&exact));
            println!("{left}: {found} where a fit from the beginning gives {exact}");
            assert!((found / exact - 1.0).abs() < 0.02, "{left}: {found} {exact}");
        }
    }
}
