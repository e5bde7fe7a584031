//! Derivatives of the residuals of a shot (a short free run), and normal equations from which the errors of the initial
//! state are eliminated.

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
/// Finite-difference step of the actuators' delay, s: half a sampling interval at 100 Hz.
const SKEW_STEP: f64 = 5e-3;

/// Finite-difference step of the actuators' blur, in squared sampling intervals.
const BLUR_STEP: f64 = 0.05;

/// Finite-difference step of a trim, relative to its prior standard deviation.
const TRIM_STEP: f64 = 1e-3;

/// Current point of the search.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// Values of the free coefficients.
    pub theta: Vec<f64>,
    /// Constants of each flight.
    pub own: Vec<Own>,
    /// Error of each shot's initial state, in the units of the state.
    pub starts: Vec<[f64; 8]>,
}

/// Weights of a shot's residuals and of its initial state's errors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights {
    /// Inverse variance of each state's residual, divided by the common correlation length (samples).
    pub output: [f64; 8],
    /// Inverse variance of the initial state's errors.
    pub start: [f64; 8],
}

/// Acting deflections, by flight, segment and model step. They are the recorded deflections after corrections of the record
/// and after the lags and delays of the model's input effects.
pub(super) type Acting = Vec<Vec<Vec<Controls>>>;

/// Perturbed models for the derivative with respect to one coefficient.
struct Variant {
    /// The model with the smaller value; `None` for the present model.
    low: Option<Side>,
    high: Side,
    /// Difference of the coefficient between both models.
    between: f64,
}

struct Side {
    model: GreyBox,
    /// Acting deflections under `model`; `None` if they are equal to those under the present model.
    acting: Option<Acting>,
}

/// The present model with the perturbed models of its derivatives.
pub(super) struct Neighbourhood {
    pub model: GreyBox,
    /// Trims and misalignment angles that are estimated for each flight, in addition to its sensor errors.
    pub asked: PerFlight,
    /// Acting deflections under the present model.
    pub acting: Acting,
    variants: Vec<Variant>,
    late: [Acting; 2],
    blurred: [Acting; 2],
}

/// Acting deflections of every flight under `model`.
pub(super) fn acting(model: &GreyBox, flights: &[Flight], place: &Place) -> Acting {
    moved(model, flights, place, SKEW, 0.0)
}

/// Acting deflections of every flight under `model`, with the sensor constant `which` increased by `by`.
fn moved(model: &GreyBox, flights: &[Flight], place: &Place, which: usize, by: f64) -> Acting {
    let one = |(f, own): (&Flight, &Own)| {
        let mut s = own.sensors;
        s[which] += by;
        shooting::acting(model, &f.prepared, &s)
    };
    flights.iter().zip(&place.own).map(one).collect()
}

impl Neighbourhood {
    /// Perturbed models around `place`.
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
    /// Information matrix after elimination of the initial state.
    pub information: DMatrix<f64>,
    /// Gradient after elimination of the initial state.
    pub gradient: DVector<f64>,
    /// Inverse information of the initial state. `coupling` is the information that couples the initial state to the other
    /// unknowns, `start_gradient` is the gradient with respect to the initial state.
    inverse: SMatrix<f64, 8, 8>,
    coupling: DMatrix<f64>,
    start_gradient: SVector<f64, 8>,
}

impl Normal {
    /// Change of the initial state that minimises the cost for a given change `step` of the other unknowns.
    pub fn start_step(&self, step: &DVector<f64>) -> [f64; 8] {
        let moved = self.coupling.transpose() * step;
        let gradient = SVector::<f64, 8>::from_fn(|i, _| self.start_gradient[i] + moved[i]);
        let step = -(self.inverse * gradient);
        std::array::from_fn(|i| step[i])
    }
}

/// Half the weighted sum of squares of a shot's residuals and of its initial state's errors.
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

/// Residuals of the free run of a shot whose flight has the constants `own`.
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

/// Derivatives of the residuals of `shot`, which has the number `index`. The columns are the free coefficients, the
/// flight's constants and the initial state. Each sample has eight rows, one for each state.
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

/// Fills the columns of the sensors' offsets: the direct effect on the residual less the effect through the initial state.
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

/// Fills the columns of the misalignment angles, which begin at `first`: the direct effect on the residual less the effect
/// through the initial state.
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
    // an explicit transpose is faster: matrix products are blocked, `tr_mul` is not
    let across = j.transpose();
    let all = &across * j;
    let gradient = &across * r;
    let mut own = SMatrix::<f64, 8, 8>::from_fn(|a, b| all[(m + a, m + b)]);
    let mut start_gradient = SVector::<f64, 8>::from_fn(|a, _| gradient[m + a]);
    for k in 0..8 {
        own[(k, k)] += w.start[k];
        start_gradient[k] += w.start[k] * from[k];
    }
    // the matrix is positive definite because of the prior; if rounding makes it singular, NaN ends the search
    let inverse = own.try_inverse().unwrap_or_else(|| SMatrix::from_element(f64::NAN));
    let coupling = all.view((0, m), (m, 8)).into_owned();
    let through = &coupling * inverse;
    let information = all.view((0, 0), (m, m)) - &through * coupling.transpose();
    let gradient = gradient.rows(0, m) - &through * start_gradient;
    Normal { information, gradient, inverse, coupling, start_gradient }
}
