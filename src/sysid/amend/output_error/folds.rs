//! Fits without one flight after the other, for cross-validation.

use std::sync::Arc;

use rayon::prelude::*;

use super::start::{Start, delays, enough};
use super::{DAMPING, Fit, FitOptions, RENEWED, Search, fit};
use crate::amend::error::AmendError;
use crate::amend::flight::{Flight, SKEW};
use crate::amend::normal::{Place, Weights};
use crate::amend::parameters;
use crate::amend::shooting::Shot;
use crate::per_flight::PerFlight;
use crate::progress::ignore_progress;
use greylag_model::GreyBox;

/// Number of Gauss–Newton steps without a flight in [`screened`].
const SCREENING_STEPS: usize = 2;

/// Fits without one flight after the other.
#[derive(Debug)]
pub struct Folds {
    /// The fit without each of the flights.
    pub fits: Vec<Result<Fit, AmendError>>,
    /// Estimates of the fit to all flights; `None` if it failed.
    pub near: Option<Near>,
}

/// Estimates of a fit to all flights, near which the fits of other structures are screened.
#[derive(Clone, Debug)]
pub struct Near {
    /// Names and values of the free coefficients.
    estimates: Vec<(String, f64)>,
    shots: Vec<Shot>,
    /// Number of shots cut short because their runs diverge.
    short: usize,
    place: Place,
    weights: Weights,
    /// Constants that were estimated for each flight.
    asked: PerFlight,
}

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
) -> Folds {
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
    let fits = left.par_iter().map(one).collect();
    Folds { fits, near: whole.as_ref().map(|(_, whole)| whole.near()) }
}

/// Does the same as [`without_each`], but makes each fit from the beginning. Coefficients without a prior can have several
/// minima. The nearest one to the fit to all flights would then know the flight that is left out.
pub fn without_each_anew(
    model: &GreyBox,
    flights: &[Flight],
    options: &FitOptions,
    left: &[usize],
) -> Folds {
    let fits = left.par_iter().map(|left| without(model, flights, options, *left)).collect();
    Folds { fits, near: None }
}

/// Estimates `model` without each of the flights `left` by two Gauss–Newton steps from `near`, which is the fit of a similar model to
/// all `flights`. A model without an estimate is `None`.
///
/// The derivatives are computed once, at the beginning, with all flights. The weights are those of `near`. `added` are the added
/// effects of `model`; coefficients that `near` lacks start at their values in `model`. This takes a few percent of the time of
/// [`without_each`].
///
/// # Errors
/// If no coefficient of `model` is free.
pub fn screened(
    model: &GreyBox,
    flights: &[Flight],
    added: &[String],
    near: &Near,
    left: &[usize],
) -> Result<Vec<Option<GreyBox>>, AmendError> {
    let start = Start::near(model, added, &near.estimates)?;
    let search = Search::new(&start, flights, near.asked).at(near);
    Ok(left.par_iter().map(|left| search.without(*left).stepped(model).ok()).collect())
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
    /// The present estimates.
    fn near(&self) -> Near {
        let values = self.free.iter().zip(&self.place.theta);
        Near {
            estimates: values.map(|(f, value)| (f.name.clone(), *value)).collect(),
            shots: self.shots.clone(),
            short: self.short,
            place: self.place.clone(),
            weights: self.weights,
            asked: self.asked,
        }
    }

    /// This search, which has not begun, with the division into shots, the constants of the flights and the weights of `near`, and
    /// with derivatives.
    fn at(mut self, near: &Near) -> Search<'a> {
        self.shots = near.shots.clone();
        self.short = near.short;
        self.weights = near.weights;
        self.place = Place { theta: self.place.theta, ..near.place.clone() };
        // a fit without the lag of an added effect takes it for a delay of the record
        if self.free.iter().any(|f| f.input && f.added) {
            for (own, expected) in self.place.own.iter_mut().zip(&self.expected) {
                own.sensors[SKEW] = expected[SKEW][0];
            }
        }
        self.residuals = self.residuals_at(&self.place);
        self.differentiate();
        self
    }

    /// `given` with the coefficients after [`SCREENING_STEPS`] steps with the same derivatives and weights.
    fn stepped(mut self, given: &GreyBox) -> Result<GreyBox, AmendError> {
        let mut damping = DAMPING;
        for _ in 0..SCREENING_STEPS {
            let system = self.system();
            if !self.step(&system, &mut damping)? {
                break;
            }
        }
        Ok(parameters::with(given, &self.free, &self.place.theta))
    }

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
        for (left, found) in all.fits.into_iter().enumerate() {
            let exact = without(&model, &flights, &options, left).unwrap();
            let judge = Judge { test: &flights[left..=left], horizons_s: &[2.0] };
            let error = |fit: &Fit| judged(&judge.scores(&fit.model)).unwrap();
            let (found, exact) = (error(&found.unwrap()), error(&exact));
            println!("{left}: {found} where a fit from the beginning gives {exact}");
            assert!((found / exact - 1.0).abs() < 0.02, "{left}: {found} {exact}");
        }
    }

    #[test]
    fn two_steps_from_the_fit_of_a_similar_model_predict_like_a_fit() {
        let model = sample::model();
        let flights: Vec<Flight> = (0..4).map(|number| flown(&model, number)).collect();
        // the model without dihedral is tuned; the dihedral that is then freed begins at zero
        let dihedral = "roll_linear.Clbeta";
        let mut lacking = model.clone();
        lacking.set_coefficient(dihedral, 0.0);
        let options = FitOptions::default();
        let tuned = without_each(&lacking, &flights, &options, &[0, 1, 2, 3]);
        let wide = lacking.clone().with_widths(|c| (c.name == dihedral).then_some(0.3));
        let near = tuned.near.unwrap();
        let quick = screened(&wide, &flights, &[], &near, &[0, 1, 2, 3]).unwrap();
        let fits = without_each(&wide, &flights, &options, &[0, 1, 2, 3]).fits;
        let error = |left: usize, model: &GreyBox| {
            let judge = Judge { test: &flights[left..=left], horizons_s: &[2.0] };
            judged(&judge.scores(model)).unwrap()
        };
        for (left, (quick, fit)) in quick.iter().zip(fits).enumerate() {
            let without = error(left, &tuned.fits[left].as_ref().unwrap().model);
            let [quick, fit] =
                [quick.as_ref().unwrap(), &fit.unwrap().model].map(|model| error(left, model));
            println!("{left}: {without} without it, {quick} screened, {fit} fitted");
            assert!(quick < 0.5 * without && quick < 2.0 * fit, "{left}: {without} {quick} {fit}");
        }
    }
}
