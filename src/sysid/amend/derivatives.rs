//! Derivatives of the residuals of the output-error fit.
//!
//! Dual numbers give the derivatives with respect to the initial state of a shot (a short open-loop simulation), the delay and
//! blur of the actuator record, the trims, and those coefficients that multiply a term of the forces and moments. A pass is a
//! simulation that gives several of these derivatives. Derivatives with respect to the other coefficients are finite differences:
//! shape constants, coefficients of input effects, and coefficients that change mass or inertia. The derivatives with respect
//! to the other constants of a flight follow from those with respect to the initial state.

use nalgebra::DMatrix;

use super::flight::{AIRSPEED, BLUR, Flight, OFFSETS, Own, SENSORS, SKEW};
use super::normal::{self, Acting, Place};
use super::parameters::{self, Free};
use super::shooting::{self, Shot};
use crate::per_flight::PerFlight;
use crate::per_flight::trims::TRIMS;
use greylag_model::{GreyBox, SLOPES, Sloped};
use greylag_num::Real;
use greylag_physics::Controls;

/// Half the finite difference of the deflections with respect to the delay of the record, s: half a sampling interval at 100 Hz.
const SKEW_STEP: f64 = 5e-3;
/// Half the finite difference of the deflections with respect to the actuators' blur, in squared sampling intervals. The blur
/// measures how far a recorded deflection is an average over time.
const BLUR_STEP: f64 = 0.05;

/// Derivatives of the residuals of a shot.
pub(super) struct Derivatives {
    /// A row for each state and sample, all samples of a state together. The columns belong to the free coefficients, the
    /// flight's constants and the initial state.
    pub rows: DMatrix<f64>,
    /// For each state, the products of all pairs of columns, summed over the samples. From them, the information matrix follows
    /// for any weights of the states.
    pub grams: Vec<DMatrix<f64>>,
}

impl Derivatives {
    fn new(rows: DMatrix<f64>) -> Derivatives {
        let steps = rows.nrows() / 8;
        let gram = |state: usize| {
            let own = rows.rows(state * steps, steps);
            // an explicit transpose is faster, because matrix products are computed in blocks and `tr_mul` is not
            own.transpose() * own
        };
        let grams = (0..8).map(gram).collect();
        Derivatives { rows, grams }
    }
}

/// The perturbed models for the finite difference with respect to one coefficient.
struct Variant {
    /// Index of the coefficient among the free ones.
    column: usize,
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

/// A variable of a pass.
#[derive(Clone, Copy, Debug)]
enum Variable {
    /// The coefficient with this index in the model's list.
    Coefficient(usize),
    /// The component of the initial state with this index.
    Start(usize),
    /// Delay of the actuator record.
    Delay,
    /// Blur of the actuator record.
    Blur,
}

/// A simulation with dual numbers.
struct Pass {
    /// The variables, each with its column in [`Derivatives::rows`].
    variables: Vec<(usize, Variable)>,
    /// For each coefficient of the model, its index among the variables; `None` for a constant.
    coefficients: Vec<Option<usize>>,
}

/// The present model, and what the derivatives need beside it.
pub(super) struct Neighbourhood {
    model: GreyBox,
    /// Trims and misalignment angles that are estimated for each flight, in addition to its sensor errors.
    asked: PerFlight,
    /// Number of free coefficients.
    free: usize,
    /// Acting deflections with the present model.
    acting: Acting,
    variants: Vec<Variant>,
    passes: Vec<Pass>,
    /// Acting deflections with a smaller and with a larger delay of the record, and the same for its blur.
    late: [Acting; 2],
    blurred: [Acting; 2],
}

impl Neighbourhood {
    /// Sets the coefficients of `base` to those of `place`, and makes the perturbed models and deflections.
    pub fn new(
        base: &GreyBox,
        free: &[Free],
        flights: &[&Flight],
        place: &Place,
        asked: PerFlight,
    ) -> Neighbourhood {
        let model = parameters::with(base, free, &place.theta);
        let (mut variants, mut variables) = (Vec::new(), Vec::new());
        for (column, f) in free.iter().enumerate() {
            let (low, high, between) = parameters::beside(base, free, &place.theta, column);
            if f.linear && !f.acting && high.body == model.body {
                variables.push((column, Variable::Coefficient(f.index)));
                continue;
            }
            let side = |model: GreyBox| {
                let acting = f.acting.then(|| normal::acting(&model, flights, place));
                Side { model, acting }
            };
            variants.push(Variant { column, low: low.map(&side), high: side(high), between });
        }
        variables.extend(of_flight(&model, free.len(), &asked));
        let count = model.coefficients().len();
        let moved = |which: usize, by: f64| {
            [-by, by].map(|by| normal::moved(&model, flights, place, which, by))
        };
        Neighbourhood {
            acting: normal::acting(&model, flights, place),
            variants,
            passes: variables.chunks(SLOPES).map(|some| Pass::new(some, count)).collect(),
            late: moved(SKEW, SKEW_STEP),
            blurred: moved(BLUR, BLUR_STEP),
            model,
            asked,
            free: free.len(),
        }
    }

    /// Index of the first column of the initial state.
    fn starts(&self) -> usize {
        self.free + SENSORS + self.asked.constants().len()
    }
}

/// Delay and blur of the actuator record, the trims if they are estimated, and the initial state, with their columns. `free` is
/// the number of free coefficients. The trims are the last coefficients of `model`.
fn of_flight(model: &GreyBox, free: usize, asked: &PerFlight) -> Vec<(usize, Variable)> {
    let mut variables = vec![(free + SKEW, Variable::Delay), (free + BLUR, Variable::Blur)];
    if asked.has_trims() {
        let first = model.coefficients().len() - TRIMS.len();
        let column = free + SENSORS + asked.angles();
        variables.extend((0..TRIMS.len()).map(|k| (column + k, Variable::Coefficient(first + k))));
    }
    let starts = free + SENSORS + asked.constants().len();
    variables.extend((0..8).map(|k| (starts + k, Variable::Start(k))));
    variables
}

impl Pass {
    fn new(variables: &[(usize, Variable)], count: usize) -> Pass {
        let mut coefficients = vec![None; count];
        for (place, (_, variable)) in variables.iter().enumerate() {
            if let Variable::Coefficient(index) = variable {
                coefficients[*index] = Some(place);
            }
        }
        Pass { variables: variables.to_vec(), coefficients }
    }

    /// Fills the columns of the variables. `own` holds the constants of the flight, `from` the errors of the initial state.
    fn fill(
        &self,
        j: &mut DMatrix<f64>,
        around: &Neighbourhood,
        flight: &Flight,
        shot: &Shot,
        (own, from): (&Own, &[f64; 8]),
    ) {
        let flight = &flight.prepared;
        let model = normal::of_flight(&around.model, own);
        let mut start = shooting::start(shot, flight, own, from).map(Sloped::from_f64);
        for (place, (_, variable)) in self.variables.iter().enumerate() {
            if let Variable::Start(state) = variable {
                start[*state].gradient[place] = 1.0;
            }
        }
        let controls = |step: usize| self.controls(around, shot, step);
        let varied = (&*model, self.coefficients.as_slice());
        shooting::fly_sloped(varied, flight, shot, controls, start, |sample, state| {
            for (k, x) in state.iter().enumerate() {
                for ((column, _), slope) in self.variables.iter().zip(x.gradient) {
                    j[(k * shot.steps + sample, *column)] = slope;
                }
            }
        });
    }

    /// Acting deflections of a model step with their derivatives with respect to delay and blur of the record.
    fn controls(&self, around: &Neighbourhood, shot: &Shot, step: usize) -> Controls<Sloped> {
        let at = |acting: &Acting| acting[shot.flight][shot.segment][step];
        let mut controls = at(&around.acting).map(Sloped::from_f64);
        for (place, (_, variable)) in self.variables.iter().enumerate() {
            let ([low, high], by) = match variable {
                Variable::Delay => (&around.late, SKEW_STEP),
                Variable::Blur => (&around.blurred, BLUR_STEP),
                Variable::Coefficient(_) | Variable::Start(_) => continue,
            };
            vary(&mut controls, place, [at(low), at(high)], 2.0 * by);
        }
        controls
    }
}

/// Sets the derivatives of `controls` with respect to the variable `place`. The variable is larger by `between` for the controls
/// `high` than for `low`.
fn vary(controls: &mut Controls<Sloped>, place: usize, [low, high]: [Controls; 2], between: f64) {
    let slope = |low: f64, high: f64| (high - low) / between;
    controls.aileron.gradient[place] = slope(low.aileron, high.aileron);
    controls.elevator.gradient[place] = slope(low.elevator, high.elevator);
    controls.throttle.gradient[place] = slope(low.throttle, high.throttle);
    controls.rudder.gradient[place] = slope(low.rudder, high.rudder);
    if let (Some(lagged), Some(low), Some(high)) = (&mut controls.lagged, low.lagged, high.lagged) {
        for (x, (low, high)) in lagged.iter_mut().zip(low.into_iter().zip(high)) {
            x.gradient[place] = slope(low, high);
        }
    }
}

/// Derivatives of the residuals of `shot`, the shot with number `index`. `here` are its residuals at `place`.
pub(super) fn derivatives(
    around: &Neighbourhood,
    flights: &[&Flight],
    (index, shot): (usize, &Shot),
    place: &Place,
    here: &[[f64; 8]],
) -> Derivatives {
    let (own, from) = (&place.own[shot.flight], &place.starts[index]);
    let (count, starts) = (around.free, around.starts());
    let mut j = DMatrix::<f64>::zeros(8 * shot.steps, starts + 8);
    for pass in &around.passes {
        pass.fill(&mut j, around, flights[shot.flight], shot, (own, from));
    }
    let fly = |side: &Side| {
        let acting = side.acting.as_ref().unwrap_or(&around.acting);
        normal::run(&side.model, acting, flights, shot, own, from)
    };
    for v in &around.variants {
        let (low, high) = (v.low.as_ref().map(&fly), fly(&v.high));
        let pairs = low.as_deref().unwrap_or(here).iter().zip(&high);
        for (sample, (a, b)) in pairs.enumerate() {
            for (k, d) in shooting::error(a, b).iter().enumerate() {
                j[(k * shot.steps + sample, v.column)] = d / v.between;
            }
        }
    }
    sensor_columns(&mut j, [count, starts], flights[shot.flight], shot);
    if around.asked.angles() > 0 {
        askew_columns(&mut j, [count + SENSORS, starts], flights[shot.flight], shot);
    }
    Derivatives::new(j)
}

/// Fills the columns of the sensor errors of airspeed, rates, α and β. A sensor error changes the recorded state directly. It
/// also changes the initial state of the simulation, which is a recorded one. A column is the first change minus the second.
fn sensor_columns(j: &mut DMatrix<f64>, [count, starts]: [usize; 2], flight: &Flight, shot: &Shot) {
    let segment = &flight.prepared.segments[shot.segment];
    for (k, state) in OFFSETS.iter().enumerate() {
        let unit = |i: usize| match *state {
            AIRSPEED => segment[shot.start + i].state.airspeed,
            _ => 1.0,
        };
        let (column, initial) = (count + SKEW + 1 + k, starts + state);
        for row in 0..j.nrows() {
            let (of, sample) = (row / shot.steps, row % shot.steps);
            let direct = if of == *state { unit(1 + sample) } else { 0.0 };
            j[(row, column)] = direct - unit(0) * j[(row, initial)];
        }
    }
}

/// Fills the columns of the misalignment angles, which begin at the index `first`. A misalignment changes the recorded states
/// directly, and the simulation through the initial state. A column is the first change minus the second.
fn askew_columns(j: &mut DMatrix<f64>, [first, starts]: [usize; 2], flight: &Flight, shot: &Shot) {
    let flight = &flight.prepared;
    let segment = &flight.segments[shot.segment][shot.start..];
    let turned: Vec<_> = segment[..=shot.steps]
        .iter()
        .map(|at| shooting::turned(flight, &at.state.to_array()))
        .collect();
    for (axis, initial) in turned[0].iter().enumerate() {
        for row in 0..j.nrows() {
            let direct = turned[1 + row % shot.steps][axis][row / shot.steps];
            let from: f64 = (0..8).map(|k| initial[k] * j[(row, starts + k)]).sum();
            j[(row, first + axis)] = direct - from;
        }
    }
}

#[cfg(test)]
mod tests;
