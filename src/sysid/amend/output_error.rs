//! Output-error estimation by multiple shooting: fits the coefficients such that short free runs follow the flights.
//!
//! A shot is a free run (open-loop simulation) from a reconstructed state. The error of this state is an unknown that is
//! eliminated from the normal equations. The sensors' remaining biases and the actuators' delay are unknowns of each flight.
//! The weights of the residuals follow from their variances and one common correlation length, which are re-estimated during
//! the search. Priors are Gaussian, with the standard deviation [`Named::width`](greylag_model::Named::width).

mod estimates;
mod folds;
mod gauss_newton;
mod shots;
mod start;
mod weights;

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::derivatives::{Derivatives, Neighbourhood, derivatives};
use super::error::AmendError;
use super::flight::{Flight, Own, SENSORS, SKEW, SKEW_LEAST};
use super::normal::{self, Place, Weights};
use super::parameters::{self, Free};
use super::result::{FittedFlight, Parameter};
use super::shooting::Shot;
use crate::per_flight::PerFlight;
use crate::progress::{Cancelled, Progress, report};
use greylag_model::GreyBox;
use start::Start;

pub(super) use folds::{Folds, Near, screened, without_each, without_each_anew};

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
/// Damping at the start of a search.
const DAMPING: f64 = 1e-6;
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
    let start = Start::of(model, flights, options, progress)?;
    start.searched(flights, options, progress)?.completed(model, options, progress)
}

/// State of a search.
struct Search<'a> {
    /// The model, with trim terms if trims are estimated.
    base: &'a GreyBox,
    /// Trims and misalignment angles that are estimated for each flight, in addition to its sensor errors.
    asked: PerFlight,
    flights: Vec<&'a Flight>,
    free: Vec<Free>,
    shots: Vec<Shot>,
    /// Derivatives of each shot's residuals, possibly computed at an earlier point of the search.
    derivatives: Vec<Arc<Derivatives>>,
    /// Number of shots cut short because their runs diverge.
    short: usize,
    place: Place,
    /// Residuals of each shot at `place`.
    residuals: Vec<Vec<[f64; 8]>>,
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
    fn new(start: &'a Start, flights: &'a [Flight], asked: PerFlight) -> Self {
        let expected: Vec<_> = flights.iter().map(|f| f.doubt).collect();
        let own = flights.iter().map(|f| Own::of(f.doubt.map(|[mean, _]| mean))).collect();
        let inverse = |sd: [f64; 8]| sd.map(|x| x.powi(-2));
        // residuals of an inaccurate model are correlated over about a fifth of a second
        let weights = Weights { output: inverse(COARSE).map(|w| w / 20.0), start: inverse(START) };
        let mut search = Search {
            base: &start.flown,
            asked,
            flights: flights.iter().collect(),
            free: start.free.clone(),
            shots: Vec::new(),
            derivatives: Vec::new(),
            short: 0,
            place: Place { theta: start.theta.clone(), own, starts: Vec::new() },
            residuals: Vec::new(),
            expected,
            weights,
            iterations: 0,
            change: (f64::INFINITY, 0),
            stuck: false,
        };
        if let Some(clocks) = &start.clocks {
            search.expect_delays(&clocks.late);
            for (own, [late, _]) in search.place.own.iter_mut().zip(&clocks.late) {
                own.sensors[SKEW] = *late;
            }
        }
        search
    }

    /// Sets the prior means (s) and standard deviations of the actuators' delays.
    fn expect_delays(&mut self, late: &[[f64; 2]]) {
        for (expected, [late, sd]) in self.expected.iter_mut().zip(late) {
            expected[SKEW] = [*late, sd.max(SKEW_LEAST)];
        }
    }

    /// Iterates estimates and weights to convergence.
    ///
    /// The derivatives are the most expensive part. They are recomputed only after the search has converged with the old
    /// derivatives. The search ends if a step with new derivatives changes no coefficient by more than `tolerance` standard
    /// deviations.
    ///
    /// `renewals` are the numbers of the computations of the derivatives; number 0 is the first one of a search with these shots.
    /// `step` receives the fraction of them that is done.
    fn settle(
        &mut self,
        renewals: Range<usize>,
        tolerance: f64,
        step: &dyn Fn(f64) -> Result<(), Cancelled>,
    ) -> Result<(), AmendError> {
        let (mut damping, end) = (DAMPING, renewals.end);
        for renewal in renewals {
            let done = renewal as f64 / end as f64;
            step(done)?;
            self.differentiate();
            let first = self.approach(renewal, &mut damping, &|| step(done))?;
            if renewal > 0 && first < tolerance {
                break;
            }
        }
        Ok(())
    }

    /// Takes steps with the same derivatives, the number `renewal` of a search, until they are small. Returns the largest change
    /// of a coefficient in the first step, in its standard deviations. `go_on` may cancel.
    fn approach(
        &mut self,
        renewal: usize,
        damping: &mut f64,
        go_on: &dyn Fn() -> Result<(), Cancelled>,
    ) -> Result<f64, AmendError> {
        let mut first = f64::INFINITY;
        for inner in 0..INNER {
            go_on()?;
            let system = self.system();
            let moved = self.step(&system, damping)?;
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
        Ok(first)
    }

    /// Computes the derivatives at the present estimates.
    fn differentiate(&mut self) {
        // the old ones are dropped first, because they take most of the memory
        self.derivatives = Vec::new();
        let (flights, place) = (&self.flights, &self.place);
        let around = Neighbourhood::new(self.base, &self.free, flights, place, self.asked);
        let one = |(shot, here): ((usize, &Shot), &Vec<[f64; 8]>)| {
            Arc::new(derivatives(&around, flights, shot, place, here))
        };
        let pairs = self.shots.par_iter().enumerate().zip(&self.residuals);
        self.derivatives = pairs.map(one).collect();
    }

    fn residuals_at(&self, place: &Place) -> Vec<Vec<[f64; 8]>> {
        let model = parameters::with(self.base, &self.free, &place.theta);
        let acting = normal::acting(&model, &self.flights, place);
        let one = |(shot, from): (&Shot, &[f64; 8])| {
            normal::run(&model, &acting, &self.flights, shot, &place.own[shot.flight], from)
        };
        self.shots.par_iter().zip(&place.starts).map(one).collect()
    }

    /// Half the weighted sum of squares of residuals, initial-state errors and deviations from the prior means. `residuals` are
    /// those at `place`.
    fn cost(&self, place: &Place, residuals: &[Vec<[f64; 8]>]) -> f64 {
        let data: f64 = (self.shots.iter().zip(residuals).zip(&place.starts))
            .map(|((shot, r), from)| normal::cost(shot, r, from, &self.weights))
            .sum();
        let (unknowns, prior) = (self.unknowns(place), self.prior());
        data + 0.5 * unknowns.component_mul(&unknowns).dot(&prior)
    }

    /// Holds the undetermined coefficients, and returns the result. `given` is the model before the fit.
    fn completed(
        mut self,
        given: &GreyBox,
        options: &FitOptions,
        progress: &Progress,
    ) -> Result<Fit, AmendError> {
        let held = self.hold_undetermined();
        if !held.is_empty() {
            let step =
                |_: f64| report(progress, "undetermined coefficients held, the others again", 0.99);
            self.settle(0..options.renewals, RENEWED, &step)?;
        }
        self.finish(given, &held)
    }
}
