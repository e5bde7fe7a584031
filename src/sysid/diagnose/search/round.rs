//! A round of the search for missing effects: the model, linearised over all flights, and the regressors (columns) of the
//! candidates (physical effects that the model may lack).
//!
//! A column has one row for each window (a short stretch of flight) and channel (a force or moment). Nuisance parameters are
//! estimated but are not of interest: coefficients of the model, constants of a flight, sensor errors. Their columns are
//! projected out of the residual (measured minus predicted value) and of the candidates' columns. Nonlinear candidates are
//! linearised at several points, which are sets of values of their coefficients.

mod curved_noise;
mod known;
mod shared_noise;
mod tuned;

use rayon::prelude::*;

use crate::diagnose::regression::catalogue::{self, Columns, Entry};
use crate::diagnose::regression::cells::{Cells, Placed};
use crate::diagnose::regression::columns::{Ready, SENSORS};
use crate::diagnose::regression::noise::Noise;
use crate::diagnose::regression::projected::{Known, Projected, scaled_inverse};
use crate::diagnose::regression::rank::{Draw, Score, Trial};
use crate::diagnose::regression::{features, shared};
use crate::per_flight::PerFlight;
use crate::weak_form::prepared::Prepared;
use greylag_model::GreyBox;
use known::{curved, known};
use shared_noise::{Setting, shared, sum};

/// Largest number of times that nonlinear candidates are linearised again at their best fits.
const REFINEMENTS: usize = 3;
/// Number of iterations of the second-order correction for the delay of the recorded actuators.
const CURVATURES: usize = 2;
/// A nonlinear candidate is linearised again if its reduction of the residual sum of squares exceeds this share of the largest
/// reduction by any candidate.
const WORTH: f64 = 0.2;
/// A nonlinear candidate is also linearised again if its evidence is less than this amount below that of the best candidate.
const CLOSE: f64 = 40.0;
/// A candidate counts as linearised near zero if the estimate of each linear coefficient is more than this number of times the
/// value at the point of linearisation.
const NOTHING: f64 = 1e3;

/// Data common to all rounds of a search.
#[derive(Clone)]
pub struct Problem {
    /// The flights, resampled to a multiple of the model's time step.
    pub flights: Vec<Prepared>,
    /// Prior mean and standard deviation of each coefficient of the model as given, in the order of the coefficients.
    pub prior: Vec<(f64, f64)>,
    /// For each flight, the errors of the reconstructed airspeed, α and β.
    pub path: Vec<shared::PathError>,
    /// For each flight, the prior standard deviations of the sensor errors.
    pub sensors: Vec<[f64; SENSORS]>,
    /// Constants that are estimated for each flight in addition to the sensor errors.
    pub per_flight: PerFlight,
    /// Seed of all random draws.
    pub seed: u64,
}

/// Results of other rounds that a round may use.
#[derive(Clone, Copy, Default)]
pub struct Beside<'a> {
    /// Noise of the channels; `None` to estimate it.
    pub noise: Option<&'a Noise>,
    /// Model that predicts the accelerations in the regressors of mass and inertia; `None` for the round's own model.
    pub accelerating: Option<&'a GreyBox>,
}

/// A model linearised over the flights.
pub struct Round {
    /// The model that is linearised.
    pub model: GreyBox,
    /// The flights, with the residuals of this model and the regressors of the sensor errors.
    pub flights: Vec<Ready>,
    /// Division of the windows into cells: one cell for each channel of each flight.
    pub cells: Cells,
    /// Nuisance parameters in this order: free coefficients of the model, constants of all flights, sensor errors of all
    /// flights.
    pub known: Vec<Known>,
    /// Index of each free coefficient among all coefficients of the model.
    pub coefficients: Vec<usize>,
    /// Constants that are estimated for each flight in addition to the sensor errors.
    pub per_flight: PerFlight,
    /// The candidate effects, with the indices of their regressors.
    pub trials: Vec<Trial>,
    /// Gram matrices of the candidates' columns and the residual, with the nuisance parameters projected out.
    pub projected: Projected,
    /// For each flight, the columns in this order: nuisance parameters, candidates, residual, features of the flexible model (a
    /// regression without physics).
    pub placed: Vec<Placed>,
    /// Index of the residual among the columns in `placed`.
    pub last: usize,
    /// Noise of the channels.
    pub noise: Noise,
    /// Number of coefficients of the model as given. Coefficients with higher indices belong to added effects.
    pub given: usize,
    /// Seed of all random draws.
    pub seed: u64,
    /// Descriptions of the candidates.
    pub entries: Vec<Entry>,
    refined: Vec<(&'static str, Vec<f64>)>,
    /// For each flight and column, the bias of the scalar product of the column and the residual. It is due to noise that both
    /// have in common (errors in variables).
    pub shared: Vec<Vec<f64>>,
    /// Columns of the nuisance parameters and of linear candidates after simulated noise was added to the flights. The indices
    /// are those of `placed`.
    pub disturbed: Vec<Placed>,
}

impl Round {
    /// Linearises `model` with `entries` as candidates. `None` if the model cannot be evaluated over the flights.
    pub fn new(problem: &Problem, model: GreyBox, entries: &[Entry]) -> Option<Round> {
        Round::beside(problem, model, entries, Beside::default())
    }

    /// Does the same as [`Round::new`], with results of other rounds.
    pub fn beside(
        problem: &Problem,
        model: GreyBox,
        entries: &[Entry],
        beside: Beside,
    ) -> Option<Round> {
        let Beside { noise, accelerating } = beside;
        let ready = |f: &Prepared| Ready::new(&model, f).accelerating_as(accelerating);
        let flights: Vec<Ready> = problem.flights.par_iter().map(ready).collect();
        let cells = Cells::new(&flights);
        let own = 0..model.coefficients().len();
        let linear = flights.par_iter().map(|f| f.linear(&model, own.clone())).collect();
        let (mut known, coefficients, mut placed) = known(problem, &model, &flights, linear);
        let features = features::features(&model, &flights, problem.seed);
        let made = catalogue::columns(&model, &flights, entries, &[]);
        let last = place(&mut placed, known.len(), &made, &flights);
        for (list, own) in placed.iter_mut().zip(features) {
            list.extend(own.into_iter().enumerate().map(|(k, c)| (last + 1 + k, c)));
        }
        let noise = noise.cloned().unwrap_or_else(|| {
            Noise::estimate(&cells, &rich(&placed, known.len(), &made.trials), last)
        });
        let kept: Vec<Placed> = placed.iter().map(|l| up_to(l, last)).collect();
        let setting = Setting { problem, model: &model, entries, accelerating };
        let (mut shared, disturbed) = shared(&setting, &cells, &kept, last, &noise);
        let sites = curved_noise::sites(&made.trials, &[], entries, known.len());
        curved_noise::add(&setting, &cells, &kept, last, &noise, &sites, &mut shared);
        let shares = sum(&shared);
        let mut projected = Projected::new(&cells, &kept, last, &known, &noise, &shares)?;
        for _ in 0..CURVATURES {
            curved(problem, &mut known, &projected);
            projected = Projected::new(&cells, &kept, last, &known, &noise, &shares)?;
        }
        Some(Round {
            model,
            flights,
            cells,
            known,
            coefficients,
            per_flight: problem.per_flight,
            trials: made.trials,
            projected,
            placed,
            last,
            noise,
            given: problem.prior.len(),
            seed: problem.seed,
            entries: entries.to_vec(),
            refined: Vec::new(),
            shared,
            disturbed,
        })
    }

    /// Returns the indices and scores of all candidates, the best first. Nonlinear candidates that rank high are linearised again
    /// at their best fit. `problem` is that of the round.
    pub fn rank(&mut self, problem: &Problem) -> Vec<(usize, Score)> {
        let mut scores = self.scores();
        for _ in 0..REFINEMENTS {
            let best = scores.first().map_or(0.0, |(_, s)| s.evidence);
            let most = scores.iter().map(|(_, s)| s.fall).fold(0.0, f64::max);
            let mut wanted: Vec<(&'static str, Vec<f64>)> = Vec::new();
            for (k, score) in &scores {
                let trial = &self.trials[*k];
                let point = &trial.points[score.point];
                let moved = point.free.iter().any(|(index, _, [low, high])| {
                    let by = (score.values[*index] - point.values[*index]).abs();
                    by > 0.02 * (high - low)
                });
                let worth = score.fall > WORTH * most || score.evidence > best - CLOSE;
                if point.contribution.is_some() && moved && worth {
                    wanted.push((trial.id, self.next_place(trial, score)));
                }
            }
            if wanted.is_empty() || !self.refine(problem, wanted) {
                break;
            }
            scores = self.scores();
        }
        scores
    }

    /// Next point of linearisation of the candidate `trial`: its estimated coefficients. A candidate that was linearised near
    /// zero keeps its shape constants (coefficients in which it is nonlinear), because the derivatives with respect to them
    /// vanish there.
    fn next_place(&self, trial: &Trial, score: &Score) -> Vec<f64> {
        let start = &trial.points[score.point].values;
        let mut next = score.values.clone();
        let Some(entry) = self.entries.iter().find(|e| e.about.id == trial.id) else { return next };
        let linear = next.len() - entry.about.shape;
        let much = |(new, old): (&f64, &f64)| new.abs() > NOTHING * old.abs();
        if linear > 0 && next[..linear].iter().zip(&start[..linear]).all(much) {
            next[linear..].copy_from_slice(&start[linear..]);
        }
        next
    }

    /// Adds the points of linearisation `wanted`, each with the id of its candidate. Returns `false` if the regressors with these
    /// points cannot be used.
    fn refine(&mut self, problem: &Problem, wanted: Vec<(&'static str, Vec<f64>)>) -> bool {
        self.refined.extend(wanted);
        let made = catalogue::columns(&self.model, &self.flights, &self.entries, &self.refined);
        let count = self.known.len();
        let mut placed: Vec<Placed> =
            self.placed.iter().map(|l| up_to(l, count.saturating_sub(1))).collect();
        let last = place(&mut placed, count, &made, &self.flights);
        let trials = [&self.trials[..], &made.trials[..]];
        let mut bias = curved_noise::carried(&self.shared, trials, count, last);
        let sites = curved_noise::sites(&made.trials, &self.trials, &self.entries, count);
        let (model, entries) = (&self.model, &self.entries[..]);
        let setting = Setting { problem, model, entries, accelerating: None };
        curved_noise::add(&setting, &self.cells, &placed, last, &self.noise, &sites, &mut bias);
        let Some(projected) =
            Projected::new(&self.cells, &placed, last, &self.known, &self.noise, &sum(&bias))
        else {
            return false;
        };
        self.shared = bias;
        for (list, old) in placed.iter_mut().zip(&self.placed) {
            let features = old.iter().filter(|(p, _)| *p > self.last);
            list.extend(features.map(|(p, c)| (p - self.last + last, c.clone())));
        }
        (self.placed, self.last, self.projected) = (placed, last, projected);
        self.trials = made.trials;
        true
    }

    /// For each column, the bias of the scalar product of the column and the residual due to common noise, summed over all
    /// flights.
    pub fn shared(&self) -> Vec<f64> {
        sum(&self.shared)
    }

    fn scores(&self) -> Vec<(usize, Score)> {
        let grams = self.projected.grams();
        let draw = Draw::measured(&grams);
        let mut scores: Vec<(usize, Score)> = (0..self.trials.len())
            .filter_map(|k| Some((k, self.trials[k].score(&grams, &draw)?)))
            .collect();
        let key = |(k, s): &(usize, Score)| (!self.at_bound(*k, s), s.order);
        scores.sort_by(|a, b| {
            let (a, b) = (key(a), key(b));
            b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
        });
        scores
    }

    /// Whether a free coefficient of the candidate with the index `trial` is at its physical bound.
    pub fn at_bound(&self, trial: usize, score: &Score) -> bool {
        let trial = &self.trials[trial];
        let Some(entry) = self.entries.iter().find(|e| e.about.id == trial.id) else {
            return false;
        };
        trial.points[score.point].free.iter().any(|(index, _, _)| {
            let (low, high) = self.model.size().bounds(&entry.about.coefficients[*index]);
            let near = 1e-6 * (high - low);
            let value = score.values[*index];
            value <= low + near || value >= high - near
        })
    }

    /// Wald statistic of the added effect `id` for the hypothesis that all its free coefficients are zero. `None` if no
    /// coefficient is free. `None` also if the effect is nonlinear in a coefficient and is no input effect, because zero
    /// coefficients then do not mean that it is absent.
    pub fn amount(&self, id: &str) -> Option<f64> {
        let prefix = format!("{id}.");
        let operator = greylag_physics::inputs::Kind::from_id(id).is_some();
        let linear = self.model.linear();
        let named = self.model.coefficients();
        let own: Vec<usize> = (0..self.coefficients.len())
            .filter(|k| named[self.coefficients[*k]].name.starts_with(&prefix))
            .collect();
        if own.is_empty() || !(operator || own.iter().all(|k| linear[self.coefficients[*k]])) {
            return None;
        }
        let p = &self.projected;
        let value = |k: &usize| named[self.coefficients[*k]].value + p.tuned[*k];
        let theta = nalgebra::DVector::from_iterator(own.len(), own.iter().map(value));
        let covariance =
            nalgebra::DMatrix::from_fn(own.len(), own.len(), |i, j| p.covariance[(own[i], own[j])]);
        Some(theta.dot(&(scaled_inverse(&covariance)? * &theta)))
    }
}

/// The columns of `list` up to and including the index `place`.
fn up_to(list: &Placed, place: usize) -> Placed {
    list.iter().take_while(|(p, _)| *p <= place).cloned().collect()
}

/// Appends the candidates' columns and the residual to `placed`, the columns of the `count` nuisance parameters. Returns the
/// index of the residual.
fn place(placed: &mut [Placed], count: usize, made: &Columns, flights: &[Ready]) -> usize {
    let last = count + made.columns.first().map_or(0, Vec::len);
    for ((list, own), flight) in placed.iter_mut().zip(&made.columns).zip(flights) {
        list.extend(own.iter().cloned().enumerate().map(|(k, c)| (count + k, c)));
        list.push((last, flight.residual.clone()));
    }
    last
}

/// The columns from which the noise is estimated: all of `placed` except the derivatives of nonlinear candidates.
fn rich(placed: &[Placed], count: usize, trials: &[Trial]) -> Vec<Placed> {
    let curved = trials.iter().flat_map(|t| &t.points).filter(|p| p.contribution.is_some());
    let left_out: Vec<usize> = curved.flat_map(|p| p.free.iter().map(|f| count + f.1)).collect();
    let keep = |l: &Placed| l.iter().filter(|(p, _)| !left_out.contains(p)).cloned().collect();
    placed.iter().map(keep).collect()
}
