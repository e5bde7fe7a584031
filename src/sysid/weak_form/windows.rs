//! Channels in weak form: measured and predicted forces, moments and rates of states for each window.
//!
//! A window is a short interval of samples. In weak form, both sides of an equation of motion are averaged over a window with a
//! smooth weight (kernel). Measured data are never differentiated: see [`Kernel`]. Products of signals are formed before this
//! smoothing.

use rayon::prelude::*;

pub use crate::weak_form::columns::{Columns, columns};

use crate::flight_path::reconstruction::Instant;
use crate::weak_form::channels::ChannelId;
use crate::weak_form::kernel::{Kernel, weigh};
use crate::weak_form::prepared::{Prepared, Window};
use greylag_logs::Sampling;
use greylag_model::{GreyBox, Integrator, Memory};
use greylag_num::Real;
use greylag_physics::rigid_body::{self, ForceAxes, RigidBody, Vector};
use greylag_physics::{AirData, Channel, Controls, State, Wrench};

/// Approximate number of windows of a flight in which the sensitivity to sensor noise is evaluated.
const NOISE_WINDOWS: usize = 40;
/// Number of windows that one thread computes at a time.
pub(super) const CHUNK: usize = 64;

/// One channel of one flight.
#[derive(Clone, Debug)]
pub struct Series {
    /// Identifier of the channel.
    pub channel: ChannelId,
    /// Measured values, one for each window, in the channel's unit. Forces are NaN in windows without specific force.
    pub measured: Vec<f64>,
    /// Predicted values in the same windows, in the channel's unit.
    pub predicted: Vec<f64>,
    /// Variance of measured − predicted due to sensor noise, in the channel's unit squared.
    pub noise_variance: f64,
}

/// All channels of a flight under `model`, with forces in the model's force axes (stability or wind axes).
///
/// Forces need the accelerometers and are left out if the flight has none.
pub fn channels(model: &GreyBox, flight: &Prepared) -> Vec<Series> {
    let flight = &*flight.acting(model);
    let steps: Vec<Vec<Vector<f64>>> = flight
        .segments
        .iter()
        .map(|s| one_step_rates(&flight.stepping(model), s, flight))
        .collect();
    let mut loads = Loads::default();
    let both: Vec<[[f64; 2]; 9]> = flight
        .windows
        .iter()
        .map(|w| window(model, flight, w, &mut loads, &steps[w.segment][w.start..]))
        .collect();
    let noise = noise_variance(model, flight);
    let series = |(k, &channel): (usize, &ChannelId)| Series {
        channel,
        measured: both.iter().map(|w| w[k][0]).collect(),
        predicted: both.iter().map(|w| w[k][1]).collect(),
        noise_variance: noise[k],
    };
    let forces = if flight.has_force() { 0 } else { 3 };
    ChannelId::ALL.iter().enumerate().skip(forces).map(series).collect()
}

/// Residuals (measured − predicted) of forces (N) and moments (N m) for an equation-error fit, a row for each window.
///
/// The columns are D, L, Y, l, m, n. Forces are NaN in windows without specific force. This function is much faster than
/// [`channels`].
pub fn force_and_moment_residuals(model: &GreyBox, flight: &Prepared) -> Vec<[f64; 6]> {
    let flight = &*flight.acting(model);
    let residuals = |windows: &[Window]| -> Vec<[f64; 6]> {
        let mut loads = Loads::default();
        let residual = |w: &Window| {
            let both = forces_and_moments(model, flight, w, &mut loads);
            std::array::from_fn(|k| both[k][0] - both[k][1])
        };
        windows.iter().map(residual).collect()
    };
    flight.windows.par_chunks(CHUNK).flat_map_iter(residuals).collect()
}

/// Pairs of measured and predicted value in one window, in the order of [`ChannelId::ALL`].
fn window(
    model: &GreyBox,
    flight: &Prepared,
    window: &Window,
    loads: &mut Loads,
    rates: &[Vector<f64>],
) -> [[f64; 2]; 9] {
    let (kernel, samples) = (&flight.kernel, flight.samples(window));
    let mut both = [[f64::NAN; 2]; 9];
    both[..6].copy_from_slice(&forces_and_moments(model, flight, window, loads));
    let slope = |of: fn(&State) -> f64| weigh(&kernel.slope, samples.iter().map(|i| of(&i.state)));
    let measured = [slope(|s| s.airspeed), slope(|s| s.alpha), slope(|s| s.beta)];
    set(&mut both[6..], measured, smooth(&kernel.step, rates.iter().copied()));
    both
}

/// The first six channels of [`window`].
fn forces_and_moments(
    model: &GreyBox,
    flight: &Prepared,
    window: &Window,
    loads: &mut Loads,
) -> [[f64; 2]; 6] {
    let (kernel, samples) = (&flight.kernel, flight.samples(window));
    let loads = loads.of(model, flight, window);
    let mut both = [[f64::NAN; 2]; 6];
    if flight.force_in(window) {
        let measured = smooth(&kernel.sample, loads.iter().map(|l| l.measured_force));
        let predicted = smooth(&kernel.sample, loads.iter().map(|l| l.force));
        set(&mut both[..3], measured, predicted);
    }
    let (turning, predicted) = if flight.sampling == Sampling::Instants {
        let part = |of: fn(&Load) -> Vector<f64>| smooth(&kernel.sample, loads.iter().map(of));
        (part(|l| l.turning), part(|l| l.moment))
    } else {
        // explicit Euler uses the start of a step; RK4 uses both ends with the controls of the start
        let at_end = |k: usize| match model.integrator {
            Integrator::Jsbsim => None,
            Integrator::Rk4 => Some([loads[k + 1].turning, moment(model, samples, k)]),
        };
        let step = |k: usize| {
            let start = [loads[k].turning, loads[k].moment];
            at_end(k).map_or(start, |end| [middle(start[0], end[0]), middle(start[1], end[1])])
        };
        let steps: Vec<[Vector<f64>; 2]> = (0..samples.len() - 1).map(step).collect();
        let part =
            |of: fn(&[Vector<f64>; 2]) -> Vector<f64>| smooth(&kernel.step, steps.iter().map(of));
        (part(|s| s[0]), part(|s| s[1]))
    };
    let measured = measured_moment(model, samples, kernel, turning);
    set(&mut both[3..6], measured, predicted);
    both
}

/// Forces and moments at a sample.
#[derive(Clone, Copy)]
struct Load {
    /// Measured and predicted D (less thrust), L and Y, N.
    measured_force: Vector<f64>,
    force: Vector<f64>,
    /// Gyroscopic moment and predicted moment, N m.
    turning: Vector<f64>,
    moment: Vector<f64>,
}

impl Load {
    fn at(model: &GreyBox, at: &Instant) -> Load {
        let air = model.air(&at.state, at.altitude);
        let [force, moment] = predicted(model, &at.state, &at.controls, &air);
        Load {
            measured_force: measured_force(model, at, &air),
            force,
            turning: gyroscopic(&model.body, &at.state),
            moment,
        }
    }
}

/// Forces and moments at the samples of a window. Those of samples that the next window also contains are kept for it.
#[derive(Default)]
struct Loads {
    /// Segment and index of the first sample.
    from: Option<(usize, usize)>,
    all: Vec<Load>,
}

impl Loads {
    /// The forces and moments at the samples of `window`. All calls must have the same `model` and `flight`.
    fn of(&mut self, model: &GreyBox, flight: &Prepared, window: &Window) -> &[Load] {
        let ahead = self.from.and_then(|(segment, start)| {
            let ahead = window.start.checked_sub(start)?;
            (segment == window.segment && ahead <= self.all.len()).then_some(ahead)
        });
        self.all.drain(..ahead.unwrap_or(self.all.len()));
        let samples = flight.samples(window);
        let known = self.all.len();
        self.all.extend(samples[known..].iter().map(|at| Load::at(model, at)));
        self.from = Some((window.segment, window.start));
        &self.all
    }
}

fn middle(a: Vector<f64>, b: Vector<f64>) -> Vector<f64> {
    std::array::from_fn(|k| 0.5 * (a[k] + b[k]))
}

fn set(both: &mut [[f64; 2]], measured: Vector<f64>, predicted: Vector<f64>) {
    for (k, place) in both.iter_mut().enumerate() {
        *place = [measured[k], predicted[k]];
    }
}

fn smooth(weights: &[f64], values: impl Iterator<Item = Vector<f64>>) -> Vector<f64> {
    let mut sum = [0.0; 3];
    for (w, x) in weights.iter().zip(values) {
        (0..3).for_each(|k| sum[k] += w * x[k]);
    }
    sum
}

/// Measured D (less thrust), L and Y from the accelerometers, N.
fn measured_force(model: &GreyBox, at: &Instant, air: &AirData) -> Vector<f64> {
    let force = at.specific_force.map(|f| f * model.body.mass);
    to_force_axes(force, air, model.axes)
}

/// Predicted D (less thrust), L and Y, N, and moment, N m. The learned residual of `model` adds the force and the moment that
/// change the rates of the state as it does.
fn predicted(
    model: &GreyBox,
    state: &State,
    controls: &Controls,
    air: &AirData,
) -> [Vector<f64>; 2] {
    let wrench = model.wrench(state, controls, air);
    let (mut force, mut moment) = (predicted_force(model, &wrench, air), moments(&wrench));
    if let Some(residual) = &model.residual {
        let rate = residual.rate(state, controls);
        let pull = rigid_body::acceleration_of(state, air, &rate).map(|a| a * model.body.mass);
        let pull = to_force_axes(pull, air, model.axes);
        let turn = inertia(&model.body, [rate.p, rate.q, rate.r]);
        force = std::array::from_fn(|k| force[k] + pull[k]);
        moment = std::array::from_fn(|k| moment[k] + turn[k]);
    }
    [force, moment]
}

pub(super) fn predicted_force(model: &GreyBox, wrench: &Wrench, air: &AirData) -> Vector<f64> {
    to_force_axes(rigid_body::body_force(wrench, air, model.axes), air, model.axes)
}

/// Converts a force in body axes, N, to D (less thrust), L and Y, N. The order is that of [`ChannelId::ALL`], whereas
/// [`rigid_body::aerodynamic_force`] has the order D, Y, L.
pub(crate) fn to_force_axes<R: Real>(
    force: Vector<R>,
    air: &AirData<R>,
    axes: ForceAxes,
) -> Vector<R> {
    let [drag, side, lift] = rigid_body::aerodynamic_force(force, air, axes);
    [drag, lift, side]
}

/// Σ K (J Δω/Δt + ω × Jω), N m, with the model's inertia. `turning` is the smoothed term ω × Jω.
fn measured_moment(
    model: &GreyBox,
    samples: &[Instant],
    kernel: &Kernel,
    turning: Vector<f64>,
) -> Vector<f64> {
    let rate = |of: fn(&State) -> f64| weigh(&kernel.slope, samples.iter().map(|i| of(&i.state)));
    let spin = [rate(|s| s.p), rate(|s| s.q), rate(|s| s.r)];
    let momentum = inertia(&model.body, spin);
    std::array::from_fn(|k| momentum[k] + turning[k])
}

/// Angular momentum J ω, N m s.
pub(crate) fn inertia<R: Real>(body: &RigidBody, w: Vector<R>) -> Vector<R> {
    [
        w[0].scale(body.jx) - w[2].scale(body.jxz),
        w[1].scale(body.jy),
        w[2].scale(body.jz) - w[0].scale(body.jxz),
    ]
}

/// Gyroscopic moment ω × J ω, N m.
pub(crate) fn gyroscopic<R: Real>(body: &RigidBody, state: &State<R>) -> Vector<R> {
    let w = [state.p, state.q, state.r];
    let h = inertia(body, w);
    [w[1] * h[2] - w[2] * h[1], w[2] * h[0] - w[0] * h[2], w[0] * h[1] - w[1] * h[0]]
}

/// Predicted moment at the sample after `samples[k]`, with the controls of `samples[k]`.
fn moment(model: &GreyBox, samples: &[Instant], k: usize) -> Vector<f64> {
    let end = &samples[k + 1];
    let air = model.air(&end.state, end.altitude);
    predicted(model, &end.state, &samples[k].controls, &air)[1]
}

fn moments(wrench: &Wrench) -> Vector<f64> {
    [Channel::Roll, Channel::Pitch, Channel::Yaw].map(|c| wrench.get(c))
}

/// Rates of V (m/s²), α and β (rad/s) that the model's integrator gives for one step from each sample.
fn one_step_rates(model: &GreyBox, segment: &[Instant], flight: &Prepared) -> Vec<Vector<f64>> {
    let mut memory = Memory::default();
    let mut rate = |k: usize| {
        let (at, next) = (&segment[k], &segment[(k + 1).min(segment.len() - 1)]);
        let (a, b) = (at.state, flight.advance(model, at.state, [at, next], &mut memory));
        [b.airspeed - a.airspeed, b.alpha - a.alpha, b.beta - a.beta].map(|x| x / flight.dt)
    };
    (0..segment.len()).map(&mut rate).collect()
}

/// Variances of the channels' residuals due to white sensor noise, in the order of [`ChannelId::ALL`].
fn noise_variance(model: &GreyBox, flight: &Prepared) -> [f64; 9] {
    let kernel = &flight.kernel;
    let squares = |w: &[f64]| w.iter().map(|x| x * x).sum::<f64>();
    let (average, slope) = (squares(&kernel.sample), squares(&kernel.slope));
    let every = flight.windows.len().div_ceil(NOISE_WINDOWS).max(1);
    let some: Vec<&Instant> = flight
        .windows
        .iter()
        .step_by(every)
        .map(|w| &flight.samples(w)[kernel.steps() / 2])
        .collect();
    let mut variance = measured_noise(model, flight, average, slope);
    for at in &some {
        let part = state_noise(model, at, &flight.noise);
        (0..9).for_each(|k| variance[k] += average * part[k] / some.len() as f64);
    }
    variance
}

/// Noise variance of the measured values alone: accelerations are weighted by the kernel; body rates, airspeed, α and β by
/// its slope.
fn measured_noise(model: &GreyBox, flight: &Prepared, average: f64, slope: f64) -> [f64; 9] {
    let [_, _, v, p, q, r, alpha, beta] = flight.noise.map(|sd| sd * sd);
    let [fx, fy, fz] = flight.force_noise.map(|sd| (model.body.mass * sd).powi(2));
    let body = &model.body;
    let [jx, jy, jz, jxz] = [body.jx, body.jy, body.jz, body.jxz].map(|j| j * j);
    let force = [fx, fz, fy].map(|x| average * x);
    let moment = [jx * p + jxz * r, jy * q, jz * r + jxz * p].map(|x| slope * x);
    let path = [v, alpha, beta].map(|x| slope * x);
    std::array::from_fn(|k| [force, moment, path][k / 3][k % 3])
}

/// Variance of the residual in one sample due to the noise of the state, by central differences.
fn state_noise(model: &GreyBox, at: &Instant, noise: &[f64; 8]) -> [f64; 9] {
    let mut variance = [0.0; 9];
    for (k, sd) in noise.iter().enumerate().filter(|(_, sd)| **sd > 0.0) {
        let moved = |by: f64| {
            let mut x = at.state.to_array();
            x[k] += by;
            residual(model, &Instant { state: State::from_array(x), ..*at })
        };
        let (up, down) = (moved(*sd), moved(-sd));
        (0..9).for_each(|c| variance[c] += (0.5 * (up[c] - down[c])).powi(2));
    }
    variance
}

/// Predicted value less the parts of the measured value that depend on the state. These parts are the specific force rotated
/// by α and β, and the gyroscopic moment.
pub(crate) fn residual(model: &GreyBox, at: &Instant) -> [f64; 9] {
    let load = Load::at(model, at);
    let known = at.specific_force.iter().all(|f| f.is_finite());
    let measured = if known { load.measured_force } else { [0.0; 3] };
    let rate = model.rate(&at.state, &at.controls, at.altitude);
    let force: Vector<f64> = std::array::from_fn(|k| load.force[k] - measured[k]);
    let moment: Vector<f64> = std::array::from_fn(|k| load.moment[k] - load.turning[k]);
    std::array::from_fn(|k| [force, moment, [rate.airspeed, rate.alpha, rate.beta]][k / 3][k % 3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn forces_and_moments_contain_the_learned_residual() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/learned/model.toml");
        let model = GreyBox::load(&path).unwrap();
        assert!(model.residual.is_some());
        let state = State::from_array([0.1, 0.1, 18.0, 0.1, 0.1, 0.1, 0.05, 0.02]);
        let (aileron, elevator) = (0.05, 0.02);
        let controls = Controls { aileron, elevator, throttle: 0.5, rudder: 0.0, lagged: None };
        let air = model.air(&state, 100.0);
        let [[drag, lift, side], moment] = predicted(&model, &state, &controls, &air);
        let mut wrench = Wrench::zero();
        let forces = [(Channel::Drag, drag), (Channel::Lift, lift), (Channel::Side, side)];
        forces.into_iter().for_each(|(channel, force)| wrench.add(channel, force));
        let force = rigid_body::body_force(&wrench, &air, model.axes);
        let gravity = rigid_body::gravity_in_body(&state, model.atmosphere.gravity);
        let pull: Vector<f64> = std::array::from_fn(|k| force[k] / model.body.mass + gravity[k]);
        let spin = rigid_body::angular_acceleration(&model.body, &state, moment);
        let rate = rigid_body::state_rate(&state, &air, pull, spin).to_array();
        let whole = model.rate(&state, &controls, 100.0).to_array();
        // airspeed, body rates, α and β
        for (x, y) in rate.iter().zip(&whole).skip(2) {
            assert!((x - y).abs() < 1e-9 * (1.0 + y.abs()), "{rate:?} {whole:?}");
        }
    }
}
