//! Derivatives and normal equations of the output-error fit.
//!
//! A shot is a short open-loop simulation (free run) along a part of a flight. The unknowns of the fit are the free coefficients
//! of the model, constants of each flight (sensor errors, misalignment angles, trims), and errors of the initial state of each
//! shot. The initial errors are eliminated from the normal equations.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use super::flight::{AIRSPEED, BLUR, Flight, OFFSETS, Own, SENSORS, SKEW};
use super::parameters::{self, Free};
use super::shooting::{self, Shot};
use crate::per_flight::{PerFlight, trims};
use greylag_model::GreyBox;
use greylag_physics::Controls;

/// Finite-difference steps of the initial state, in the units of the state (rad, m/s, rad/s).
const STATE_STEP: [f64; 8] = [1e-5, 1e-5, 1e-3, 1e-4, 1e-4, 1e-4, 1e-5, 1e-5];
/// Finite-difference step of the delay of the recorded actuators, s: half a sampling interval at 100 Hz.
const SKEW_STEP: f64 = 5e-3;

/// Finite-difference step of the actuators' blur, in squared sampling intervals. The blur measures how far a recorded deflection
/// is an average over time.
const BLUR_STEP: f64 = 0.05;

/// Finite-difference step of a trim (a coefficient offset of one flight), as a fraction of its prior standard deviation.
const TRIM_STEP: f64 = 1e-3;

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

/// The perturbed models for the derivative with respect to one coefficient.
struct Variant {
    /// The model with the smaller value; `None` for the present model.
    low: Option<Side>,
    high: Side,
    /// Value of the coefficient in the model `high` minus that in the other model.
    between: f64,
}

struct Side {
    model: GreyBox,
    /// Acting deflections with `model`; `None` if they equal those with the present model.
    acting: Option<Acting>,
}

/// The present model, and the perturbed models and deflections for the derivatives.
pub(super) struct Neighbourhood {
    pub model: GreyBox,
    /// Trims and misalignment angles that are estimated for each flight, in addition to its sensor errors.
    pub asked: PerFlight,
    /// Acting deflections with the present model.
    pub acting: Acting,
    variants: Vec<Variant>,
    late: [Acting; 2],
    blurred: [Acting; 2],
}

/// Acting deflections of every flight with `model`.
pub(super) fn acting(model: &GreyBox, flights: &[Flight], place: &Place) -> Acting {
    moved(model, flights, place, SKEW, 0.0)
}

/// Acting deflections of every flight with `model`, after the sensor constant with index `which` was increased by `by`.
fn moved(model: &GreyBox, flights: &[Flight], place: &Place, which: usize, by: f64) -> Acting {
    let one = |(f, own): (&Flight, &Own)| {
        let mut s = own.sensors;
        s[which] += by;
        shooting::acting(model, &f.prepared, &s)
    };
    flights.iter().zip(&place.own).map(one).collect()
}

impl Neighbourhood {
    /// Sets the coefficients of `base` to those of `place`, and makes the perturbed models and deflections.
    pub fn new(
        base: &GreyBox,
        free: &[Free],
        flights: &[Flight],
        place: &Place,
        asked: PerFlight,
    ) -> Neighbourhood {
        let model = parameters::with(base, free, &place.theta);
        let variant = |k: usize| {
            let (low, high, between) = parameters::beside(base, free, &place.theta, k);
            let side = |model: GreyBox| {
                let acting = free[k].acting.then(|| acting(&model, flights, place));
                Side { model, acting }
            };
            Variant { low: low.map(side), high: side(high), between }
        };
        Neighbourhood {
            acting: acting(&model, flights, place),
            variants: (0..free.len()).map(variant).collect(),
            late: [-SKEW_STEP, SKEW_STEP].map(|by| moved(&model, flights, place, SKEW, by)),
            blurred: [-BLUR_STEP, BLUR_STEP].map(|by| moved(&model, flights, place, BLUR, by)),
            model,
            asked,
        }
    }
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
    flights: &[Flight],
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

/// Derivatives of the residuals of `shot`, the shot with number `index`. The columns belong to the free coefficients, the
/// flight's constants and the initial state. There are eight rows per sample, one for each state.
pub(super) fn jacobian(
    around: &Neighbourhood,
    flights: &[Flight],
    shot: &Shot,
    index: usize,
    place: &Place,
) -> DMatrix<f64> {
    let (own, from) = (&place.own[shot.flight], &place.starts[index]);
    let fly = |model: &GreyBox, controls: &Acting, from: &[f64; 8]| {
        run(model, controls, flights, shot, own, from)
    };
    let here = fly(&around.model, &around.acting, from);
    let count = around.variants.len();
    let constants = around.asked.constants();
    let starts = count + SENSORS + constants.len();
    let mut j = DMatrix::<f64>::zeros(8 * shot.steps, starts + 8);
    let mut fill = |column: usize, low: &[[f64; 8]], high: &[[f64; 8]], between: f64| {
        let mut column = j.column_mut(column);
        for (k, (a, b)) in low.iter().zip(high).enumerate() {
            for (i, d) in shooting::error(a, b).iter().enumerate() {
                column[8 * k + i] = d / between;
            }
        }
    };
    for (column, v) in around.variants.iter().enumerate() {
        let side = |s: &Side| fly(&s.model, s.acting.as_ref().unwrap_or(&around.acting), from);
        let low = v.low.as_ref().map(side);
        fill(column, low.as_ref().unwrap_or(&here), &side(&v.high), v.between);
    }
    for (which, sides, step) in
        [(SKEW, &around.late, SKEW_STEP), (BLUR, &around.blurred, BLUR_STEP)]
    {
        let [low, high] = [0, 1].map(|side| fly(&around.model, &sides[side], from));
        fill(count + which, &low, &high, 2.0 * step);
    }
    for (i, step) in STATE_STEP.iter().enumerate() {
        let mut moved = *from;
        moved[i] += step;
        let high = fly(&around.model, &around.acting, &moved);
        fill(starts + i, &here, &high, *step);
    }
    let angles = around.asked.angles();
    for (i, constant) in constants[angles..].iter().enumerate() {
        let (mut moved, step) = (*own, TRIM_STEP * constant.width);
        moved.trims[i] += step;
        let high = run(&around.model, &around.acting, flights, shot, &moved, from);
        fill(count + SENSORS + angles + i, &here, &high, step);
    }
    sensor_columns(&mut j, [count, starts], flights, shot);
    if angles > 0 {
        askew_columns(&mut j, [count + SENSORS, starts], flights, shot);
    }
    j
}

/// Normal equations of a shot from `jacobian`, the derivatives of its residuals.
pub(super) fn normal(
    jacobian: &DMatrix<f64>,
    residuals: &[[f64; 8]],
    shot: &Shot,
    from: &[f64; 8],
    w: &Weights,
) -> Normal {
    let root: [f64; 8] = w.output.map(|x| (shot.weight * x).sqrt());
    let mut j = jacobian.clone();
    for mut column in j.column_iter_mut() {
        column.iter_mut().enumerate().for_each(|(row, x)| *x *= root[row % 8]);
    }
    let r = DVector::from_fn(j.nrows(), |row, _| root[row % 8] * residuals[row / 8][row % 8]);
    eliminate(&j, &r, from, w)
}

/// Fills the columns of the sensor errors of airspeed, rates, α and β. A sensor error changes the recorded state directly. It
/// also changes the initial state of the simulation, which is a recorded one. A column is the first change minus the second.
fn sensor_columns(
    j: &mut DMatrix<f64>,
    [count, starts]: [usize; 2],
    flights: &[Flight],
    shot: &Shot,
) {
    let segment = &flights[shot.flight].prepared.segments[shot.segment];
    for (k, state) in OFFSETS.iter().enumerate() {
        let unit = |i: usize| match *state {
            AIRSPEED => segment[shot.start + i].state.airspeed,
            _ => 1.0,
        };
        let (column, initial) = (count + SKEW + 1 + k, starts + state);
        for row in 0..j.nrows() {
            let direct = if row % 8 == *state { unit(1 + row / 8) } else { 0.0 };
            j[(row, column)] = direct - unit(0) * j[(row, initial)];
        }
    }
}

/// Fills the columns of the misalignment angles, which begin at the index `first`. A misalignment changes the recorded states
/// directly, and the simulation through the initial state. A column is the first change minus the second.
fn askew_columns(
    j: &mut DMatrix<f64>,
    [first, starts]: [usize; 2],
    flights: &[Flight],
    shot: &Shot,
) {
    let flight = &flights[shot.flight].prepared;
    let segment = &flight.segments[shot.segment];
    let turned = |i: usize| shooting::turned(flight, &segment[shot.start + i].state.to_array());
    for (axis, initial) in turned(0).iter().enumerate() {
        for row in 0..j.nrows() {
            let direct = turned(1 + row / 8)[axis][row % 8];
            let from: f64 = (0..8).map(|k| initial[k] * j[(row, starts + k)]).sum();
            j[(row, first + axis)] = direct - from;
        }
    }
}

fn eliminate(j: &DMatrix<f64>, r: &DVector<f64>, from: &[f64; 8], w: &Weights) -> Normal {
    let m = j.ncols() - 8;
    // an explicit transpose is faster, because matrix products are computed in blocks and `tr_mul` is not
    let across = j.transpose();
    let all = &across * j;
    let gradient = &across * r;
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
