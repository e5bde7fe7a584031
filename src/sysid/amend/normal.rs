//! Normal equations of the output-error fit.
//!
//! A shot is a short open-loop simulation (free run) along a part of a flight. The unknowns of the fit are the free coefficients
//! of the model, constants of each flight (sensor errors, misalignment angles, trims), and errors of the initial state of each
//! shot. The initial errors are eliminated from the normal equations.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::derivatives::Derivatives;
use super::flight::{Flight, Own, SKEW};
use super::shooting::{self, Shot};
use crate::per_flight::trims;
use greylag_model::GreyBox;
use greylag_physics::Controls;

/// Present values of the unknowns.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// Values of the free coefficients.
    pub theta: Vec<f64>,
    /// Constants of each flight.
    pub own: Vec<Own>,
    /// Errors of each shot's initial state, in the units of the state.
    pub starts: Vec<[f64; 8]>,
}

/// Weights in the cost of a shot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights {
    /// For the residual of each state: its inverse variance, divided by the correlation length (samples) of the residuals.
    pub output: [f64; 8],
    /// For the error of each initial state: its inverse prior variance.
    pub start: [f64; 8],
}

/// Acting deflections, indexed by flight, segment and model step. They follow from the recorded deflections by correction of the
/// record's delay and blur, and by the model's input effects, such as lags.
pub(super) type Acting = Vec<Vec<Vec<Controls>>>;

/// Acting deflections of every flight with `model`.
pub(super) fn acting(model: &GreyBox, flights: &[&Flight], place: &Place) -> Acting {
    moved(model, flights, place, SKEW, 0.0)
}

/// Acting deflections of every flight with `model`, after the sensor constant with index `which` was increased by `by`.
pub(super) fn moved(
    model: &GreyBox,
    flights: &[&Flight],
    place: &Place,
    which: usize,
    by: f64,
) -> Acting {
    let one = |(f, own): (&&Flight, &Own)| {
        let mut s = own.sensors;
        s[which] += by;
        shooting::acting(model, &f.prepared, &s)
    };
    flights.iter().zip(&place.own).map(one).collect()
}

/// Normal equations of a shot for the free coefficients and the constants of the shot's flight.
pub(super) struct Normal {
    /// Information matrix after elimination of the initial state's errors.
    pub information: DMatrix<f64>,
    /// Gradient of the cost after elimination of the initial state's errors.
    pub gradient: DVector<f64>,
    /// Inverse of the information matrix of the initial state. `coupling` is the block of the full information matrix between
    /// the other unknowns and the initial state. `start_gradient` is the gradient with respect to the initial state.
    inverse: SMatrix<f64, 8, 8>,
    coupling: DMatrix<f64>,
    start_gradient: SVector<f64, 8>,
}

impl Normal {
    /// The change of the initial state that minimises the cost for a given change `step` of the other unknowns.
    pub fn start_step(&self, step: &DVector<f64>) -> [f64; 8] {
        let moved = self.coupling.transpose() * step;
        let gradient = SVector::<f64, 8>::from_fn(|i, _| self.start_gradient[i] + moved[i]);
        let step = -(self.inverse * gradient);
        std::array::from_fn(|i| step[i])
    }
}

/// Cost of a shot: half the weighted sum of the squares of its residuals and of its initial state's errors `start`.
pub(super) fn cost(shot: &Shot, residuals: &[[f64; 8]], start: &[f64; 8], w: &Weights) -> f64 {
    let square = |x: &[f64; 8], w: &[f64; 8]| (0..8).map(|k| w[k] * x[k] * x[k]).sum::<f64>();
    let output: f64 = residuals.iter().map(|r| square(r, &w.output)).sum();
    0.5 * (shot.weight * output + square(start, &w.start))
}

/// `model` with the trims of a flight; unchanged if all trims are zero.
pub(super) fn of_flight<'a>(model: &'a GreyBox, own: &Own) -> Cow<'a, GreyBox> {
    if own.trims.iter().all(|trim| *trim == 0.0) {
        return Cow::Borrowed(model);
    }
    let mut of_flight = model.clone();
    trims::set(&mut of_flight, &own.trims);
    Cow::Owned(of_flight)
}

/// Residuals of a shot whose flight has the constants `own` and whose initial state has the errors `from`. `controls` are the
/// acting deflections.
pub(super) fn run(
    model: &GreyBox,
    controls: &Acting,
    flights: &[&Flight],
    shot: &Shot,
    own: &Own,
    from: &[f64; 8],
) -> Vec<[f64; 8]> {
    let flight = &flights[shot.flight].prepared;
    let start = shooting::start(shot, flight, own, from);
    let model = &*of_flight(model, own);
    let path = shooting::fly(model, flight, shot, &controls[shot.flight][shot.segment], start);
    shooting::residuals(flight, shot, own, &model.scale(), &path)
}

/// Normal equations of a shot from the derivatives of its residuals.
pub(super) fn normal(
    derivatives: &Derivatives,
    residuals: &[[f64; 8]],
    shot: &Shot,
    from: &[f64; 8],
    w: &Weights,
) -> Normal {
    let (steps, columns) = (residuals.len(), derivatives.rows.ncols());
    let mut all = DMatrix::<f64>::zeros(columns, columns);
    let mut gradient = DVector::<f64>::zeros(columns);
    for (state, gram) in derivatives.grams.iter().enumerate() {
        let weight = shot.weight * w.output[state];
        let own = DVector::from_iterator(steps, residuals.iter().map(|r| r[state]));
        gradient.gemv_tr(weight, &derivatives.rows.rows(state * steps, steps), &own, 1.0);
        let sums = all.as_mut_slice().iter_mut().zip(gram.as_slice());
        sums.for_each(|(sum, x)| *sum += weight * x);
    }
    eliminate(&all, &gradient, from, w)
}

/// Eliminates the initial state's errors `from` from the information matrix `all` and the `gradient` of the residuals. They are
/// the last eight unknowns.
fn eliminate(all: &DMatrix<f64>, gradient: &DVector<f64>, from: &[f64; 8], w: &Weights) -> Normal {
    let m = all.ncols() - 8;
    let mut own = SMatrix::<f64, 8, 8>::from_fn(|a, b| all[(m + a, m + b)]);
    let mut start_gradient = SVector::<f64, 8>::from_fn(|a, _| gradient[m + a]);
    for k in 0..8 {
        own[(k, k)] += w.start[k];
        start_gradient[k] += w.start[k] * from[k];
    }
    // the matrix is positive definite because of the prior; if rounding makes it singular, the NaN ends the fit
    let inverse = own.try_inverse().unwrap_or_else(|| SMatrix::from_element(f64::NAN));
    let coupling = all.view((0, m), (m, 8)).into_owned();
    let through = &coupling * inverse;
    let information = all.view((0, 0), (m, m)) - &through * coupling.transpose();
    let gradient = gradient.rows(0, m) - &through * start_gradient;
    Normal { information, gradient, inverse, coupling, start_gradient }
}
