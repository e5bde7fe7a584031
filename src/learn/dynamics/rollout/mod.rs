//! Simulation of the learned model from recorded states (rollouts). The module also computes the gradient of the training
//! objective by backpropagation through the simulation. Source: eqs. (20) and (22) of \[GSFM26\] (see `src/lib.rs`).
//!
//! The state rate of the model is F_p + F_a. The prior F_p is a physical model whose coefficients may be trained. The residual
//! F_a is a neural network. A block of rollouts is computed at once, one in each lane of a SIMD vector. The forward pass
//! stores a trace, which the reverse pass reads.

mod jsbsim;
mod rk4;

use crate::dynamics::kernel::InstructionSet;
use crate::dynamics::network::Passes;
use crate::dynamics::packet::Packet;
use crate::dynamics::prior::{At, PriorOutputs, Slopes};
use greylag_model::residual::Scales;
use greylag_model::{GreyBox, Integrator};
use greylag_num::Real;
use greylag_physics::actuators::LAGS;
use greylag_physics::effects::Needs;
use greylag_physics::rigid_body::Vector;
use greylag_physics::{Controls, State};

/// Number of points (evaluations of the network) whose weight gradients are summed together. Their data fit into the cache.
const CHUNK: usize = 20;

/// The model that is learned.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The prior with its present coefficients. If it has a residual of its own, that residual is not used.
    pub prior: GreyBox,
    /// Network of the residual.
    pub network: Passes,
    /// Input and output scales of the residual.
    pub scales: Scales,
    /// Whether the gradient with respect to the prior's coefficients is computed.
    pub prior_slopes: PriorSlopes,
}

/// Whether the gradient with respect to the prior's coefficients is computed. It is needed only if they are trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PriorSlopes {
    /// The gradient is not computed.
    None,
    /// The gradient is computed with respect to all coefficients and to the product of inertia Jxz.
    All,
}

/// Recorded data of `Packet::WIDTH` rollouts.
#[derive(Clone, Debug, Default)]
pub struct Recorded<R> {
    /// States one step before the start, at the start, and after each step. Roll is between −π and π.
    pub states: Vec<[R; 8]>,
    /// Aileron, elevator, throttle and rudder that act in each step, including the step before the start.
    pub controls: Vec<[R; 4]>,
    /// Values of the formulas' `lag(…)` and `delay(…)` terms in each step, including the step before the start; empty
    /// for a model without such terms.
    pub lagged: Vec<[R; LAGS]>,
    /// Air density in each step, including the step before the start, kg/m³.
    pub density: Vec<R>,
    /// Weight of each rollout; 0 for a rollout that only fills the block.
    pub weight: Option<R>,
}

/// Data that the forward pass stores for the reverse pass. Step 0 is the step before the start of the rollout. Only
/// [`Integrator::Jsbsim`] computes it, because that integrator uses the acceleration of the previous step.
#[derive(Clone, Debug)]
pub struct Trace<R> {
    /// The states at which the model was evaluated: one per step, four per step for RK4.
    states: Vec<State<R>>,
    /// The network's activations at each of these states.
    units: Vec<R>,
    /// State rates F_p and F_a at the start of each step.
    rates: Vec<[State<R>; 2]>,
    /// The states after each step.
    ends: Vec<State<R>>,
    /// The acceleration in each step, and the acceleration of the step before, which the integrator keeps.
    memory: Vec<[Vector<R>; 2]>,
    /// Gradients with respect to the network's pre-activations at the last [`CHUNK`] points.
    slopes: Vec<R>,
    /// Gradient with respect to the prior's coefficients, summed over points.
    coefficients: Vec<R>,
}

/// Results of a forward pass: weighted sums over the rollouts. x_c is the scale of each state, eq. (21).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Σ over steps of ‖(ŝ − s)/x_c‖², with the predicted state ŝ and the recorded state s.
    pub error: f64,
    /// Σ over steps of ‖F_p/x_c‖².
    pub prior: f64,
    /// Σ over steps of ‖F_a/x_c‖².
    pub learned: f64,
}

/// Derivatives of the objective with respect to the three [`Sums`].
pub type SumSlopes = Sums;

/// Gradient of the objective with respect to the trained parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradient {
    /// Gradient with respect to the network's parameters.
    pub network: Vec<f64>,
    /// Gradient with respect to the prior's coefficients, then Jxz (kg m²).
    pub prior: Vec<f64>,
}

/// Number of model evaluations per step.
const fn stages(integrator: Integrator) -> usize {
    match integrator {
        Integrator::Rk4 => 4,
        Integrator::Jsbsim => 1,
    }
}

impl<R: Packet> Trace<R> {
    /// Memory for rollouts of up to `steps` steps of `subject`.
    pub fn new(subject: &Subject, steps: usize) -> Self {
        let points = (steps + 1) * stages(subject.prior.integrator);
        let nothing = nothing();
        Trace {
            states: vec![nothing; points],
            units: vec![R::zero(); points * subject.network.trace()],
            rates: vec![[nothing; 2]; steps + 1],
            ends: vec![nothing; steps + 1],
            memory: vec![[[R::zero(); 3]; 2]; steps + 1],
            slopes: vec![R::zero(); CHUNK * subject.network.slopes()],
            coefficients: vec![R::zero(); subject.prior.coefficients().len() + 1],
        }
    }
}

#[inline(always)]
fn nothing<R: Real>() -> State<R> {
    State::from_array([R::zero(); 8])
}

#[inline(always)]
fn sum<R: Real>(a: &State<R>, b: &State<R>) -> State<R> {
    a.advance(b, 1.0)
}

/// Inputs of a forward or reverse pass over one block of rollouts.
pub struct Pass<'a, S: InstructionSet> {
    /// The instruction set for which the pass is compiled.
    pub set: S,
    /// The model under training.
    pub subject: &'a Subject,
    /// The recorded data of the block.
    pub recorded: &'a Recorded<S::Number>,
    /// The scale by which errors and rates are divided: x_c, eq. (21), or ones.
    pub scale: &'a [f64; 8],
}

impl<R: Packet, S: InstructionSet<Number = R>> Pass<'_, S> {
    fn steps(&self) -> usize {
        self.recorded.controls.len() - 1
    }

    /// Simulates the block. Returns the sums, and one number per lane that is finite only if all states of that lane's rollout
    /// are finite.
    #[inline(always)]
    pub fn forward(&self, trace: &mut Trace<R>) -> (Sums, R) {
        let totals = match self.subject.prior.integrator {
            Integrator::Rk4 => self.forward_rk4(trace),
            Integrator::Jsbsim => self.forward_jsbsim(trace),
        };
        let [error, prior, learned] = totals.map(|t| t.sum().into());
        (Sums { error, prior, learned }, totals[0] + totals[1] + totals[2])
    }

    /// Adds to `gradient` the gradient of the objective with respect to the trained parameters. `of` holds the derivatives of
    /// the objective with respect to the sums of the forward pass.
    #[inline(always)]
    pub fn reverse(&self, trace: &mut Trace<R>, of: &SumSlopes, gradient: &mut Gradient) {
        trace.coefficients.fill(R::zero());
        match self.subject.prior.integrator {
            Integrator::Rk4 => self.reverse_rk4(trace, of, gradient),
            Integrator::Jsbsim => self.reverse_jsbsim(trace, of, gradient),
        }
        for (sum, part) in gradient.prior.iter_mut().zip(&trace.coefficients) {
            *sum += part.sum().into();
        }
    }

    #[inline(always)]
    fn at(&self, step: usize, state: State<R>) -> At<R> {
        let [aileron, elevator, throttle, rudder] = self.recorded.controls[step];
        let controls = Controls {
            aileron,
            elevator,
            throttle,
            rudder,
            lagged: self.recorded.lagged.get(step).copied(),
        };
        At { state, controls, density: self.recorded.density[step] }
    }

    /// The prior's outputs at the point `at`.
    #[inline(always)]
    fn ask(&self, at: &At<R>) -> PriorOutputs<R> {
        let model = &self.subject.prior;
        match model.needs() {
            Needs::Point => self.set.ask::<false>(model, at),
            _ => self.set.ask::<true>(model, at),
        }
    }

    /// State rates F_a of the residual at the point `at`. Stores state and activations in `trace` under the index `point`.
    #[inline(always)]
    fn learned(&self, at: &At<R>, point: usize, trace: &mut Trace<R>) -> State<R> {
        let Subject { network, scales, .. } = self.subject;
        let width = network.trace();
        let units = &mut trace.units[point * width..][..width];
        trace.states[point] = at.state;
        scales.rate(network.forward(scales.inputs(&at.state, &at.controls), units))
    }

    /// x/x_c² and ‖x/x_c‖², both multiplied by the weight of the rollout.
    #[inline(always)]
    fn weighted(&self, x: [R; 8]) -> ([R; 8], R) {
        let weight = self.recorded.weight.unwrap_or(R::from_f64(1.0));
        let mut square = R::zero();
        let mut half_slope = x;
        for (x, scale) in half_slope.iter_mut().zip(self.scale) {
            let y = (*x * weight).scale(1.0 / (scale * scale));
            square += *x * y;
            *x = y;
        }
        (half_slope, square)
    }

    /// The error ŝ − s after `step`, with the roll error wrapped to −π..π, in the form that [`Pass::weighted`] returns.
    #[inline(always)]
    fn error(&self, step: usize, predicted: &State<R>) -> ([R; 8], R) {
        use std::f64::consts::{PI, TAU};
        let mut error = predicted.to_array();
        for (error, seen) in error.iter_mut().zip(&self.recorded.states[step + 1]) {
            *error -= *seen;
        }
        let (half, turn) = (R::from_f64(PI), R::from_f64(TAU));
        error[0] = R::where_less(half, error[0], error[0] - turn, error[0]);
        error[0] = R::where_less(error[0], -half, error[0] + turn, error[0]);
        self.weighted(error)
    }

    /// Adds to `totals` the squared norms of the error, of F_p and of F_a in `step`.
    #[inline(always)]
    fn tally(&self, step: usize, trace: &Trace<R>, totals: &mut [R; 3]) {
        let [prior, learned] = &trace.rates[step];
        totals[0] += self.error(step, &trace.ends[step]).1;
        totals[1] += self.weighted(prior.to_array()).1;
        totals[2] += self.weighted(learned.to_array()).1;
    }

    /// Derivatives of the objective with respect to the state after `step`, to F_p and to F_a, through the terms of this step in
    /// the sums only.
    #[inline(always)]
    fn direct(&self, step: usize, trace: &Trace<R>, of: &SumSlopes) -> [State<R>; 3] {
        let [prior, learned] = &trace.rates[step];
        let error = State::from_array(self.error(step, &trace.ends[step]).0);
        let prior = State::from_array(self.weighted(prior.to_array()).0);
        let learned = State::from_array(self.weighted(learned.to_array()).0);
        [
            nothing().advance(&error, 2.0 * of.error),
            nothing().advance(&prior, 2.0 * of.prior),
            nothing().advance(&learned, 2.0 * of.learned),
        ]
    }

    /// Backpropagates through prior and residual at the point `place`. `prior` and `learned` are the derivatives of the objective
    /// with respect to F_p and F_a. Returns the gradient with respect to the state at the point, and adds the gradient with
    /// respect to the trained parameters to `gradient`. Must be called for the points in descending order.
    #[inline(always)]
    fn point(
        &self,
        trace: &mut Trace<R>,
        place: Place,
        prior: &Slopes<R>,
        learned: &State<R>,
        gradient: &mut Gradient,
    ) -> State<R> {
        let Place { step, point, first } = place;
        let Subject { network, scales, .. } = self.subject;
        let at = self.at(step, trace.states[point]);
        let model = &self.subject.prior;
        let learned_too = self.subject.prior_slopes == PriorSlopes::All;
        let mut slope = if model.needs() == Needs::Point {
            if learned_too {
                self.set.coefficients::<false>(model, &at, prior, &mut trace.coefficients);
            }
            self.set.slope::<false>(model, &at, prior)
        } else {
            if learned_too {
                self.set.coefficients::<true>(model, &at, prior, &mut trace.coefficients);
            }
            self.set.slope::<true>(model, &at, prior)
        };
        let (width, wide) = (network.trace(), network.slopes());
        let slot = (point - first) % CHUNK;
        let mut output = learned.to_array();
        for (slope, scale) in output.iter_mut().zip(&scales.output) {
            *slope = slope.scale(*scale);
        }
        let units = &trace.units[point * width..][..width];
        let input = network.backward(units, output, &mut trace.slopes[slot * wide..][..wide]);
        // the network's first six inputs are the states 2 to 7, airspeed to sideslip
        for i in 0..6 {
            slope[2 + i] = input[i].mul_add(R::from_f64(scales.factor[i]), slope[2 + i]);
        }
        if slot == 0 {
            let points = (self.steps() + 1) * stages(self.subject.prior.integrator);
            let count = CHUNK.min(points - point);
            let units = &trace.units[point * width..][..count * width];
            network.gather(units, &trace.slopes[..count * wide], &mut gradient.network);
        }
        State::from_array(slope)
    }
}

/// A point of a rollout, at which prior and residual are evaluated.
#[derive(Clone, Copy)]
struct Place {
    /// Step to which the point belongs.
    step: usize,
    /// Index of the point in the trace.
    point: usize,
    /// Index of the first point of the rollout in the trace.
    first: usize,
}
