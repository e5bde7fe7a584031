//! Regressors (columns) of the regression that searches for missing effects. A column has the change of forces and moments for
//! one unit of a parameter. It has one row for each window, a short stretch of flight over which they are averaged.
//!
//! The parameters are those of candidates (physical effects that the model may lack), and nuisance parameters: sensor errors and
//! coefficients of the model.

use std::ops::Range;

use crate::diagnose::regression::gather::{Column, gather, rates};
use crate::diagnose::regression::local::{self, ALPHA, CHANNELS, CONTROLS, INPUTS};
use crate::flight_path::reconstruction::Instant;
use crate::weak_form::prepared::Prepared;
use crate::weak_form::windows::{gyroscopic, inertia, to_force_axes};
use greylag_logs::Sampling;
use greylag_model::GreyBox;
use greylag_physics::inputs as input_effects;
use greylag_physics::rigid_body::{self, RigidBody, Vector};
use greylag_physics::{Channel, Wrench};

/// Number of sensor errors of a flight. Their order is:
/// - biases of the gyros p, q, r, rad/s;
/// - biases of α and β, rad;
/// - relative error of the airspeed;
/// - biases of the accelerometers x, y, z, m/s²;
/// - delays of α, β, airspeed and accelerometers, s;
/// - delay of the angular accelerations relative to the moments, s;
/// - delay of the actuator record, s;
/// - averaging ("blur") of the actuator record: half of the variance of the times over which a recorded value is averaged,
///   in squared sampling intervals.
pub const SENSORS: usize = 16;

/// A flight with the predictions of a model, and their derivatives.
#[derive(Clone, Debug)]
pub struct Ready {
    /// The flight as measured.
    pub measured: Prepared,
    /// The flight with the deflections after the model's input effects, for example an actuator lag.
    pub acting: Prepared,
    /// Residual, measured minus predicted: forces in N, moments in N m.
    pub residual: Column,
    /// Change of the residual for one unit of each sensor error, in the order of [`SENSORS`].
    pub sensors: Vec<Column>,
    /// Derivatives of the prediction with respect to aileron, elevator and throttle, by segment and sample.
    controls: Vec<Vec<[[f64; CHANNELS]; 3]>>,
    /// Model that predicts the accelerations in the regressors of mass and inertia. `None` if it is the model that predicts
    /// `residual`.
    accelerating: Option<GreyBox>,
}

impl Ready {
    /// Evaluates `flight` under `model`.
    pub fn new(model: &GreyBox, flight: &Prepared) -> Ready {
        let acting = flight.acting(model).into_owned();
        let locals: Vec<Vec<local::Local>> = acting
            .segments
            .iter()
            .map(|s| s.iter().map(|at| local::local(model, at, &at.controls)).collect())
            .collect();
        let mut columns = gather(&acting, model.integrator, 1 + INPUTS + 3 + 7, |place, add| {
            // RK4 also evaluates the end of a step; the derivatives there are approximated by those at its start
            let here = &locals[place.segment][place.index];
            let value = if place.at.time_s == acting.segments[place.segment][place.index].time_s {
                here.value
            } else {
                local::local(model, place.at, place.controls).value
            };
            (0..CHANNELS).for_each(|c| add(0, c, value[c]));
            for (i, slope) in here.slope.iter().enumerate() {
                (0..CHANNELS).for_each(|c| add(1 + i, c, slope[c]));
            }
            let v = place.at.state.airspeed;
            (0..CHANNELS).for_each(|c| add(1 + ALPHA + 2, c, (v - 1.0) * here.slope[ALPHA + 2][c]));
            let air = model.air(&place.at.state, place.at.altitude);
            for axis in 0..3 {
                let mut force = [0.0; 3];
                force[axis] = model.body.mass;
                let force = to_force_axes(force, &air, model.axes);
                (0..3).for_each(|c| add(1 + INPUTS + axis, c, force[c]));
            }
            let flow = |i: &Instant| [i.state.alpha, i.state.beta, i.state.airspeed];
            for (i, rate) in
                differences(&acting, place.segment, place.index, flow).iter().enumerate()
            {
                let slope = &here.slope[ALPHA + i];
                (0..CHANNELS).for_each(|c| add(1 + INPUTS + 3 + i, c, -rate * slope[c]));
            }
            for (i, rate) in
                differences(&acting, place.segment, place.index, steered).iter().enumerate()
            {
                let slope = &here.slope[CONTROLS + i];
                (0..CHANNELS).for_each(|c| add(1 + INPUTS + 8, c, -rate * slope[c]));
            }
            for (i, bend) in bends(&acting, place.segment, place.index).iter().enumerate() {
                let slope = &here.slope[CONTROLS + i];
                (0..CHANNELS).for_each(|c| add(1 + INPUTS + 9, c, bend * slope[c]));
            }
            // the effect of a delay T in J ω̇ + ω × J ω = M(t − T) is to first order T Σ ∂(ω × J ω − M)/∂x ẋ
            if acting.sampling == Sampling::Instants {
                let rates = differences(&acting, place.segment, place.index, inputs);
                for (slope, rate) in here.slope.iter().zip(rates) {
                    (3..CHANNELS).for_each(|c| add(1 + INPUTS + 7, c, rate * slope[c]));
                }
            }
            let force = differences(&acting, place.segment, place.index, |i| i.specific_force);
            if force.iter().all(|f| f.is_finite()) {
                let force = to_force_axes(force.map(|f| -f * model.body.mass), &air, model.axes);
                (0..3).for_each(|c| add(1 + INPUTS + 6, c, force[c]));
            }
        });
        let mut residual = std::mem::take(&mut columns[0]);
        add_spin(model, &acting, &mut residual);
        let sensors = (1..=CONTROLS).chain(1 + INPUTS..1 + INPUTS + 10);
        let sensors: Vec<Column> = sensors.map(|k| std::mem::take(&mut columns[k])).collect();
        let controls = locals
            .iter()
            .map(|s| {
                s.iter().map(|l| [0, 1, 2].map(|i| l.slope[CONTROLS + i].map(|x| -x))).collect()
            })
            .collect();
        let accelerating = None;
        Ready { measured: flight.clone(), acting, residual, sensors, controls, accelerating }
    }

    /// Sets the model that predicts the accelerations in the regressors of mass and inertia. `None` is the model that predicts
    /// `residual`.
    pub fn accelerating_as(self, model: Option<&GreyBox>) -> Ready {
        Ready { accelerating: model.cloned(), ..self }
    }

    /// Regressors of the coefficients with the indices `wanted` in `model`: predicted forces and moments for one unit of each
    /// coefficient. `model` must have at least the effects of the model of this flight. The columns of nonlinear coefficients are
    /// empty, also those of input effects.
    pub fn linear(&self, model: &GreyBox, wanted: Range<usize>) -> Vec<Column> {
        // a formula with a lag needs lagged deflections, which the model of this flight may not have computed
        let remembered = (model.lags() > 0).then(|| self.measured.acting(model));
        let acting = remembered.as_deref().unwrap_or(&self.acting);
        let mut columns = gather(acting, model.integrator, wanted.len(), |place, add| {
            let at = place.at;
            let air = model.air(&at.state, at.altitude);
            model.contributions(&at.state, place.controls, &air, |index, channel, amount: f64| {
                if !wanted.contains(&index) {
                    return;
                }
                let column = index - wanted.start;
                match channel {
                    Channel::Drag => add(column, 0, amount),
                    Channel::Lift => add(column, 1, amount),
                    Channel::Side => add(column, 2, amount),
                    Channel::Roll => add(column, 3, amount),
                    Channel::Pitch => add(column, 4, amount),
                    Channel::Yaw => add(column, 5, amount),
                    Channel::BodyX => {
                        let mut wrench = Wrench::zero();
                        wrench.add(channel, amount);
                        let force = rigid_body::body_force(&wrench, &air, model.axes);
                        let force = to_force_axes(force, &air, model.axes);
                        (0..3).for_each(|c| add(column, c, force[c]));
                    }
                }
            });
        });
        for (column, index) in wanted.enumerate() {
            if let Some((body, step)) = changed_body(model, index) {
                let of_body = self.body(model, &body, step);
                columns[column].iter_mut().zip(of_body).for_each(|(a, b)| join(a, b));
            }
            if let Some(of_servo) = self.servo(model, index) {
                columns[column] = of_servo;
            }
        }
        columns
    }

    /// Regressor of a parameter of mass or inertia. A change of the parameter by `step` changes the rigid body of `model` to
    /// `body`. The accelerations are predicted, because measured ones contain the same noise as the residual.
    fn body(&self, model: &GreyBox, body: &RigidBody, step: f64) -> Column {
        let old = &model.body;
        let model = self.accelerating.as_ref().unwrap_or(model);
        let mut columns = gather(&self.acting, model.integrator, 1, |place, add| {
            let state = &place.at.state;
            let air = model.air(state, place.at.altitude);
            let wrench = model.wrench(state, place.controls, &air);
            let force = rigid_body::body_force(&wrench, &air, model.axes);
            let force = to_force_axes(force, &air, model.axes);
            let heavier = (body.mass - old.mass) / model.body.mass;
            (0..3).for_each(|c| add(0, c, -force[c] * heavier / step));
            let (_, spin) = model.accelerations(state, place.controls, &air);
            let moment = |body: &RigidBody| {
                let (a, b): (Vector<f64>, Vector<f64>) =
                    (inertia(body, spin), gyroscopic(body, state));
                [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
            };
            let (new, old) = (moment(body), moment(old));
            (0..3).for_each(|c| add(0, 3 + c, (old[c] - new[c]) / step));
        });
        columns.pop().unwrap_or_default()
    }

    /// Regressor of the coefficient with the index `index` of `model`, if it is the constant of an input effect that is linear
    /// in it, as the curve of a servo is. Empty in the channels in which the effect does not act. `None` for other coefficients.
    fn servo(&self, model: &GreyBox, index: usize) -> Option<Column> {
        const MOVED: f64 = 0.1;
        let named = &model.coefficients()[index];
        let (id, _) = named.name.split_once('.')?;
        if input_effects::Kind::from_id(id)?.describe().shape > 0 {
            return None;
        }
        let at = |value: f64| {
            let mut moved = model.clone();
            moved.set_coefficient(&named.name, value);
            self.operator(&moved)
        };
        let (up, down) = (at(named.value + MOVED), at(named.value - MOVED));
        let mut column = combine(&[up, down], &[0.5 / MOVED, -0.5 / MOVED]);
        let silent = |x: &f64| *x == 0.0 || x.is_nan();
        column.iter_mut().filter(|c| c.iter().all(silent)).for_each(Vec::clear);
        Some(column)
    }

    /// Contribution of an input effect that `model` has in addition to the model of this flight: the difference of the
    /// predictions of the two models, to first order in the changes of deflections and throttle.
    pub fn operator(&self, model: &GreyBox) -> Column {
        let other = self.measured.acting(model);
        let mut columns = gather(&self.acting, model.integrator, 1, |place, add| {
            let (k, i) = (place.segment, place.index);
            let (a, b) = (&self.acting.segments[k][i].controls, &other.segments[k][i].controls);
            let moved = [b.aileron - a.aileron, b.elevator - a.elevator, b.throttle - a.throttle];
            for (slopes, moved) in self.controls[k][i].iter().zip(moved) {
                slopes.iter().enumerate().for_each(|(c, slope)| add(0, c, moved * slope));
            }
        });
        columns.pop().unwrap_or_default()
    }
}

/// The sum of `columns` with the weights `weights`.
pub fn combine(columns: &[Column], weights: &[f64]) -> Column {
    let mut sum = Column::default();
    for (column, weight) in columns.iter().zip(weights) {
        for (a, b) in sum.iter_mut().zip(column) {
            join(a, b.iter().map(|x| weight * x).collect());
        }
    }
    sum
}

fn join(a: &mut Vec<f64>, b: Vec<f64>) {
    if a.is_empty() {
        *a = b;
    } else {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
    }
}

/// Whether mass or inertia of `model` depends on the coefficient with the index `index`.
pub fn of_body(model: &GreyBox, index: usize) -> bool {
    changed_body(model, index).is_some()
}

/// Perturbs the coefficient with the index `index` of `model`. Returns the resulting rigid body and the perturbation. `None` if
/// the rigid body does not depend on the coefficient.
fn changed_body(model: &GreyBox, index: usize) -> Option<(RigidBody, f64)> {
    const MOVED: f64 = 1e-3;
    let mut moved = model.clone();
    let named = &model.coefficients()[index];
    moved.set_coefficient(&named.name, named.value + MOVED);
    (moved.body != model.body).then_some((moved.body, MOVED))
}

/// Adds J ω̇ with the measured angular acceleration ω̇ to the residual of the moments.
fn add_spin(model: &GreyBox, flight: &Prepared, residual: &mut Column) {
    let spins = rates(flight, |i| [i.state.p, i.state.q, i.state.r]);
    let moments: Vec<Vector<f64>> = spins.iter().map(|w| inertia(&model.body, *w)).collect();
    for axis in 0..3 {
        join(&mut residual[3 + axis], moments.iter().map(|m| m[axis]).collect());
    }
}

/// Aileron, elevator, throttle and rudder, in this order.
fn steered(i: &Instant) -> [f64; 4] {
    let z = &i.controls;
    [z.aileron, z.elevator, z.throttle, z.rudder]
}

/// The inputs of [`local`](local::local), in their order.
fn inputs(i: &Instant) -> [f64; INPUTS] {
    let (s, [aileron, elevator, throttle, rudder]) = (&i.state, steered(i));
    [s.p, s.q, s.r, s.alpha, s.beta, s.airspeed, aileron, elevator, throttle, rudder]
}

/// Second differences of aileron, elevator, throttle and rudder, in this order, at one sample.
pub fn bends(flight: &Prepared, segment: usize, index: usize) -> [f64; 4] {
    let instants = &flight.segments[segment];
    let (before, after) = (index.saturating_sub(1), (index + 1).min(instants.len() - 1));
    let [a, b, c] = [before, index, after].map(|i| steered(&instants[i]));
    [0, 1, 2, 3].map(|k| a[k] - 2.0 * b[k] + c[k])
}

/// Time derivatives of the quantities `of` at one sample, by central differences.
fn differences<const N: usize>(
    flight: &Prepared,
    segment: usize,
    index: usize,
    of: impl Fn(&Instant) -> [f64; N],
) -> [f64; N] {
    let instants = &flight.segments[segment];
    let (before, after) = (index.saturating_sub(1), (index + 1).min(instants.len() - 1));
    let per = 1.0 / (flight.dt * (after - before).max(1) as f64);
    let (a, b) = (of(&instants[before]), of(&instants[after]));
    std::array::from_fn(|k| (b[k] - a[k]) * per)
}
