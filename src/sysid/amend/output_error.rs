//! Output-error estimation by multiple shooting: fits the coefficients such that short free runs follow the flights.
//!
//! A shot is a free run (open-loop simulation) from a reconstructed state. The error of this state is an unknown that is
//! eliminated from the normal equations. The sensors' remaining biases and the actuators' delay are unknowns of each flight.
//! The weights of the residuals follow from their variances and one common correlation length, which are re-estimated during
//! the search. Priors are Gaussian, with the standard deviation [`Named::width`](greylag_model::Named::width).

mod estimates;
mod gauss_newton;
mod weights;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::equation_error;
use super::error::AmendError;
use super::flight::{Flight, Own, SENSORS, SKEW, SKEW_LEAST};
use super::learned;
use super::normal::{self, Neighbourhood, Place, Weights};
use super::parameters::{self, Free};
use super::result::{FittedFlight, Parameter};
use super::shooting::{self, Shot};
use crate::diagnose::search::clocks::{self, Clocks};
use crate::per_flight::{PerFlight, trims};
use crate::progress::{Cancelled, Progress, report};
use greylag_model::GreyBox;
use greylag_num::statistics::quantile;

/// Smallest usable duration of all flights together, s.
pub const LEAST_S: f64 = 10.0;
/// The steps with the same derivatives end when no coefficient changes by more than this number of standard deviations.
const STEP_TOLERANCE: f64 = 0.03;
/// Derivatives are recomputed until a step with new derivatives changes no coefficient by more than this number of standard
/// deviations.
const RENEWED: f64 = 0.1;
/// Replaces `RENEWED` for all shot lengths except the last.
const NEAR: f64 = 5.0;
/// Largest number of steps with the same derivatives.
const INNER: usize = 6;
/// Standard deviations of the residuals assumed at the start, in the units of the state.
const COARSE: [f64; 8] = [0.02, 0.02, 0.4, 0.05, 0.05, 0.05, 0.02, 0.02];
/// Prior standard deviations of a reconstructed state's errors, in the units of the state.
const START: [f64; 8] = [3e-3, 3e-3, 0.15, 5e-3, 5e-3, 5e-3, 3e-3, 3e-3];

/// Options of a fit.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// Identifiers of the added effects (physical contributions to forces and moments) in the model. Their coefficients have only
    /// their bounds as a prior.
    pub added: Vec<String>,
    /// Lengths of the shots, s. The fit uses one length after the other.
    pub lengths_s: Vec<f64>,
    /// Largest number of times that the derivatives are computed for the last length.
    pub renewals: usize,
    /// Trims and misalignment angles that are estimated for each flight, in addition to its sensor errors.
    pub per_flight: PerFlight,
}

impl Default for FitOptions {
    fn default() -> Self {
        let per_flight = PerFlight::default();
        FitOptions { added: Vec::new(), lengths_s: vec![1.0, 5.0], renewals: 8, per_flight }
    }
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The model with the fitted coefficients.
    pub model: GreyBox,
    /// The coefficients that were free.
    pub parameters: Vec<Parameter>,
    /// Estimated constants of each flight: sensor errors, and misalignment angles and trims if asked for.
    pub flights: Vec<FittedFlight>,
    /// Standard deviations of the residuals, in the order and the units of the state.
    pub residual_sd: [f64; 8],
    /// Number of shots of the last length.
    pub shots: usize,
    /// Number of shots of the last length that are down-weighted or cut short.
    pub weakened: usize,
    /// Residuals of each shot of the last length.
    pub(super) left: Vec<Left>,
    /// Weights of the residuals in `left`.
    pub(super) weights: Weights,
    /// Number of iterations made.
    pub iterations: usize,
    /// Sentence on the parameter that had not converged when the search ended; `None` if all parameters converged. The last
    /// change of this parameter widens all intervals.
    pub unsettled: Option<String>,
    /// Notes on the fit for the user, in sentences.
    pub notes: Vec<String>,
}

/// Residuals of one shot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Left {
    /// Indices of flight, segment and first sample.
    pub shot: [usize; 3],
    /// Sum of the squared residuals of each state, in the unit of the state squared.
    pub output: [f64; 8],
    /// Squared errors of the initial state, in the unit of the state squared.
    pub start: [f64; 8],
}

/// Fits the free coefficients of `model` to `flights`. `progress` receives the stages and may cancel.
///
/// # Errors
/// The flights are shorter than `LEAST_S` in total, two flights with constants of their own have the same name, no
/// coefficient is free, the flights excite no free coefficient, free runs diverge too early, the search does not converge or
/// its equations are singular, or `progress` cancelled.
pub fn fit(
    model: &GreyBox,
    flights: &[Flight],
    options: &FitOptions,
    progress: &Progress,
) -> Result<Fit, AmendError> {
    let name = || model.name.clone();
    let flown_s: f64 = flights.iter().map(Flight::seconds).sum();
    if flown_s < LEAST_S {
        return Err(AmendError::TooLittle { model: name(), flown_s, needed_s: LEAST_S });
    }
    let names: Vec<&str> = flights.iter().map(|f| f.prepared.name.as_str()).collect();
    learned::distinct(&names, &options.per_flight)?;
    let added: Vec<&str> = options.added.iter().map(String::as_str).collect();
    let free = parameters::free(model, &added);
    if free.is_empty() {
        return Err(AmendError::NothingFree { model: name() });
    }
    let doing = format!("{}: equation error over {} flight(s)", model.name, flights.len());
    report(progress, &doing, 0.0)?;
    let clocks = match free.iter().any(|f| f.input && f.added) {
        true => clocks(model, &free, flights, options.per_flight),
        false => None,
    };
    let theta = match &clocks {
        Some(clocks) => values(&clocks.model, &free),
        None => equation_error::start(model, &free, flights),
    };
    let asked = options.per_flight;
    let given = values(model, &free);
    let flown = if asked.has_trims() { trims::joined(model)? } else { model.clone() };
    let mut search = Search::new(&flown, flights, free, theta, asked);
    if let Some(clocks) = clocks {
        search.set_clocks(&clocks.late);
    }
    for (k, length_s) in options.lengths_s.iter().enumerate() {
        let doing = format!("{}: output error over {length_s} s", model.name);
        let share = 0.9 / options.lengths_s.len() as f64;
        let from = 0.1 + share * k as f64;
        let step = |share_done: f64| report(progress, &doing, from + share * share_done);
        step(0.0)?;
        if k == 0 {
            search.start_from_the_closer(&given, *length_s);
        }
        search.shots_of(*length_s)?;
        // only the last length determines the result
        match k + 1 == options.lengths_s.len() {
            true => search.settle(options.renewals, RENEWED, &step)?,
            false => search.settle(options.renewals.min(2), NEAR, &step)?,
        }
    }
    let held = search.hold_undetermined();
    if !held.is_empty() {
        let step =
            |_: f64| report(progress, "undetermined coefficients held, the others again", 0.99);
        search.settle(options.renewals, RENEWED, &step)?;
    }
    search.finish(model, &held)
}

/// Estimates the delays of the recorded actuators from forces and moments, together with the input effects of the model.
/// Free runs cannot distinguish a delay of the record from a delay of the actuators.
fn clocks(
    model: &GreyBox,
    free: &[Free],
    flights: &[Flight],
    per_flight: PerFlight,
) -> Option<Clocks> {
    let given = free.iter().filter(|f| f.added).map(|f| f.index).min()?;
    let flights: Vec<_> = flights.iter().map(|f| (&f.prepared, &f.forces)).collect();
    clocks::clocks(model, given, &flights, per_flight)
}

/// Values of the free coefficients in `model`, limited to their bounds.
fn values(model: &GreyBox, free: &[Free]) -> Vec<f64> {
    let of = |f: &Free| model.coefficients()[f.index].value.clamp(f.bounds.0, f.bounds.1);
    free.iter().map(of).collect()
}

/// State of a search.
struct Search<'a> {
    /// The model, with trim terms if trims are estimated.
    base: &'a GreyBox,
    /// Trims and misalignment angles that are estimated for each flight, in addition to its sensor errors.
    asked: PerFlight,
    flights: &'a [Flight],
    free: Vec<Free>,
    shots: Vec<Shot>,
    /// Derivatives of each shot's residuals, possibly computed at an earlier point of the search.
    jacobians: Vec<DMatrix<f64>>,
    /// Number of shots cut short because their runs diverge.
    short: usize,
    place: Place,
    /// Prior mean and standard deviation of each sensor constant of each flight.
    expected: Vec<[[f64; 2]; SENSORS]>,
    weights: Weights,
    iterations: usize,
    /// Largest change of a coefficient in the last step, in its standard deviations, and the coefficient's index.
    change: (f64, usize),
    /// Whether the last step was rejected because no damping decreased the cost. This can happen because the cost is
    /// discontinuous, for example where a run begins to stall.
    stuck: bool,
}

impl<'a> Search<'a> {
    fn new(
        base: &'a GreyBox,
        flights: &'a [Flight],
        free: Vec<Free>,
        theta: Vec<f64>,
        asked: PerFlight,
    ) -> Self {
        let expected: Vec<_> = flights.iter().map(|f| f.doubt).collect();
        let own = flights.iter().map(|f| Own::of(f.doubt.map(|[mean, _]| mean))).collect();
        let inverse = |sd: [f64; 8]| sd.map(|x| x.powi(-2));
        // residuals of an inaccurate model are correlated over about a fifth of a second
        let weights = Weights { output: inverse(COARSE).map(|w| w / 20.0), start: inverse(START) };
        Search {
            base,
            asked,
            flights,
            free,
            shots: Vec::new(),
            jacobians: Vec::new(),
            short: 0,
            place: Place { theta, own, starts: Vec::new() },
            expected,
            weights,
            iterations: 0,
            change: (f64::INFINITY, 0),
            stuck: false,
        }
    }

    /// Sets the prior means (s) and standard deviations of the actuators' delays.
    fn set_clocks(&mut self, clocks: &[[f64; 2]]) {
        let flights = self.expected.iter_mut().zip(&mut self.place.own);
        for ((expected, own), [late, sd]) in flights.zip(clocks) {
            expected[SKEW] = [*late, sd.max(SKEW_LEAST)];
            own.sensors[SKEW] = *late;
        }
    }

    /// Cuts the flights into shots of `length_s` (s), and shortens the shots in which the present model diverges.
    fn shots_of(&mut self, length_s: f64) -> Result<(), AmendError> {
        self.shots = shooting::cut(self.flights, length_s);
        self.place.starts = vec![[0.0; 8]; self.shots.len()];
        let model = parameters::with(self.base, &self.free, &self.place.theta);
        let acting = normal::acting(&model, self.flights, &self.place);
        let reach: Vec<usize> = self
            .shots
            .par_iter()
            .map(|shot| {
                let flight = &self.flights[shot.flight].prepared;
                let own = &self.place.own[shot.flight];
                let start = shooting::start(shot, flight, own, &[0.0; 8]);
                let controls = &acting[shot.flight][shot.segment];
                let model = normal::of_flight(&model, own);
                shooting::fly(&model, flight, shot, controls, start).len()
            })
            .collect();
        self.short = 0;
        for (shot, reach) in self.shots.iter_mut().zip(&reach) {
            if *reach < shot.steps {
                // only the first three quarters of the run before divergence are used
                shot.steps = reach * 3 / 4;
                self.short += 1;
            }
        }
        let worth = |shot: &Shot| {
            shot.steps as f64 * self.flights[shot.flight].prepared.dt >= shooting::SHORTEST_S
        };
        let left = self.shots.iter().filter(|s| worth(s)).count();
        if 2 * left < self.shots.len() {
            let reach: Vec<f64> = self
                .shots
                .iter()
                .zip(reach)
                .map(|(s, r)| r as f64 * self.flights[s.flight].prepared.dt)
                .collect();
            let reach_s = quantile(&reach, 0.5);
            return Err(AmendError::Diverges { model: self.base.name.clone(), reach_s });
        }
        self.shots.retain(worth);
        self.place.starts.truncate(self.shots.len());
        Ok(())
    }

    /// Iterates estimates and weights to convergence.
    ///
    /// The derivatives are the most expensive part. They are recomputed only after the search has converged with the old
    /// derivatives. The search ends if a step with new derivatives changes no coefficient by more than `tolerance` standard
    /// deviations. `step` receives the fraction of `renewals` that is done.
    fn settle(
        &mut self,
        renewals: usize,
        tolerance: f64,
        step: &dyn Fn(f64) -> Result<(), Cancelled>,
    ) -> Result<(), AmendError> {
        let mut damping = 1e-6;
        for renewal in 0..renewals {
            let done = renewal as f64 / renewals as f64;
            step(done)?;
            self.differentiate();
            let mut first = f64::INFINITY;
            for inner in 0..INNER {
                step(done)?;
                let system = self.system();
                let moved = self.step(&system, &mut damping)?;
                self.stuck = !moved;
                self.iterations += 1;
                if inner == 0 {
                    first = self.change.0;
                }
                if self.change.0 < 3.0 || renewal + inner < 2 {
                    self.reweigh();
                }
                if !moved || self.change.0 < STEP_TOLERANCE {
                    break;
                }
            }
            if renewal > 0 && first < tolerance {
                break;
            }
        }
        Ok(())
    }

    fn differentiate(&mut self) {
        let around =
            Neighbourhood::new(self.base, &self.free, self.flights, &self.place, self.asked);
        let one = |(index, shot): (usize, &Shot)| {
            normal::jacobian(&around, self.flights, shot, index, &self.place)
        };
        self.jacobians = self.shots.par_iter().enumerate().map(one).collect();
    }

    fn residuals(&self) -> Vec<Vec<[f64; 8]>> {
        self.residuals_at(&self.place)
    }

    fn residuals_at(&self, place: &Place) -> Vec<Vec<[f64; 8]>> {
        let model = parameters::with(self.base, &self.free, &place.theta);
        let acting = normal::acting(&model, self.flights, place);
        let one = |(shot, from): (&Shot, &[f64; 8])| {
            normal::run(&model, &acting, self.flights, shot, &place.own[shot.flight], from)
        };
        self.shots.par_iter().zip(&place.starts).map(one).collect()
    }

    /// Half the weighted sum of squares of residuals, initial-state errors and deviations from the prior means.
    fn cost(&self, place: &Place) -> f64 {
        let residuals = self.residuals_at(place);
        let data: f64 = (self.shots.iter().zip(&residuals).zip(&place.starts))
            .map(|((shot, r), from)| normal::cost(shot, r, from, &self.weights))
            .sum();
        let (unknowns, prior) = (self.unknowns(place), self.prior());
        data + 0.5 * unknowns.component_mul(&unknowns).dot(&prior)
    }
}
