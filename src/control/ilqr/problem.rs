//! The optimal control problem that iLQR (iterative linear quadratic regulator) solves at each tick of 10 ms. This file
//! computes the simulated trajectory of a plan, its cost, and the derivatives of both. A plan is a sequence of aileron and
//! elevator commands over the horizon.

use nalgebra::{SMatrix, SVector};

use super::cost::{Cost, attitude, beyond, square};
use super::course::{Approach, Course, wrapped};
use super::settings::Settings;
use super::transition::{Filter, Transition};
use super::{STEPS, Surfaces};
use crate::envelope::{Bounds, load_factor, load_factor_slopes};
use crate::lqi::{Ahead, Goal};
use crate::policy::{Actor, observe};
use crate::{Observation, Target};
use greylag_model::{GreyBox, Memory, STEP, linearise_step};
use greylag_num::dense::Units;
use greylag_physics::actuators::Actuators;
use greylag_physics::inputs::InputMemory;
use greylag_physics::{Command, Controls, State};

/// Number of states: the aircraft's eight ([`State`]), then four for aileron and four for elevator. The four states of a surface
/// are its deflection now and one step ago, and its last two commanded deflections, rad.
pub(super) const STATES: usize = 16;

/// Indices of the deflections of aileron and elevator in the state vector. After each follow the other three states of the
/// surface.
pub(super) const SURFACES: [usize; 2] = [8, 12];

/// A matrix over the states.
pub(super) type Square = SMatrix<f64, STATES, STATES>;
/// A vector over the states.
pub(super) type Vector = SVector<f64, STATES>;

/// An angle of attack beyond the first value adds to the cost; the second value is the scale of the excess, rad. Both are used
/// only if the settings or the problem have no envelope limits.
const STALL: [f64; 2] = [0.16, 0.02];

/// The optimal control problem of one tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Problem<'a> {
    pub model: &'a GreyBox,
    /// The observation of this tick, from which the plan starts.
    pub seen: &'a Observation,
    pub goal: Goal,
    /// Attitude reference at each step of the plan.
    pub course: &'a Course,
    /// Limits and gains of the reference path to the target. `None` if the reference is the target itself.
    pub approach: Option<&'a Approach>,
    /// Constant throttle over the plan, 0..1.
    pub throttle: f64,
    /// Constant rudder command over the plan, from the LQI (linear quadratic controller with integral action).
    pub rudder: f64,
    pub memory: Memory,
    /// Constant disturbance added to the model's state rate, per second.
    pub disturbance: State,
    pub settings: &'a Settings,
    /// Limits of load factor, angle of attack and sideslip; an excess adds to the cost. `None` for a cost without these limits.
    pub bounds: Option<Bounds>,
}

/// States and deflections at each step of a plan. `filters` has the four states of aileron and of elevator.
#[derive(Clone, Debug)]
pub(super) struct Trajectory {
    states: Vec<State>,
    controls: Vec<Controls>,
    filters: Vec<[[f64; 4]; 2]>,
}

impl Trajectory {
    pub fn new() -> Trajectory {
        Trajectory {
            states: vec![State::NEUTRAL; STEPS + 1],
            controls: vec![Controls::default(); STEPS + 1],
            filters: vec![[[0.0; 4]; 2]; STEPS + 1],
        }
    }

    pub fn states(&self) -> impl Iterator<Item = &State> {
        self.states.iter()
    }

    /// The state vector of this trajectory at `step` minus that of `other`.
    pub fn less(&self, other: &Trajectory, step: usize) -> Vector {
        self.at(step) - other.at(step)
    }

    /// The state vector at `step`.
    pub fn at(&self, step: usize) -> Vector {
        let s = self.states[step].to_array();
        let mut x = Vector::zeros();
        x.as_mut_slice()[..8].copy_from_slice(&s);
        for (at, filter) in SURFACES.into_iter().zip(&self.filters[step]) {
            x.as_mut_slice()[at..at + 4].copy_from_slice(filter);
        }
        x
    }
}

/// The simulated aircraft.
struct Flight {
    state: State,
    actuators: Actuators,
    memory: Memory,
    inputs: InputMemory,
    previous: [Command; 2],
}

impl Problem<'_> {
    fn start(&self) -> Flight {
        let figures = &self.model.airframe.actuators;
        let Observation { state, actuators, previous, .. } = *self.seen;
        let actuators = Actuators::from_observed(&actuators, &previous, figures);
        let inputs = self.model.at_rest(&actuators.controls());
        Flight { state, actuators, memory: self.memory, inputs, previous }
    }

    fn advance(&self, flight: &mut Flight, [aileron, elevator]: Surfaces) {
        let controls = self.model.act(&flight.actuators.controls(), &mut flight.inputs);
        let next =
            self.model.step(&flight.state, &controls, self.seen.altitude, &mut flight.memory);
        flight.state = next.advance(&self.disturbance, STEP);
        let command = Command { aileron, elevator, throttle: self.throttle, rudder: self.rudder };
        flight.actuators.step(&command, &self.model.airframe.actuators);
        flight.previous = [command, flight.previous[0]];
    }

    /// Writes the state of `flight` into `out` at `step`.
    fn note(&self, flight: &Flight, step: usize, out: &mut Trajectory) {
        let figures = &self.model.airframe.actuators;
        let z = flight.actuators.observed(figures);
        let (ailerons, elevators) = (figures.aileron.travel, figures.elevator.travel);
        let [new, old] = flight.previous;
        out.states[step] = flight.state;
        out.controls[step] = flight.actuators.controls();
        out.filters[step] = [
            [
                z.aileron,
                z.aileron - z.aileron_rate * STEP,
                ailerons.deflection(new.aileron),
                ailerons.deflection(old.aileron),
            ],
            [
                z.elevator,
                z.elevator - z.elevator_rate * STEP,
                elevators.deflection(new.elevator),
                elevators.deflection(old.elevator),
            ],
        ];
    }

    /// Simulates a plan, writes its trajectory to `out` and returns its cost.
    pub fn fly(&self, plan: &[Surfaces; STEPS], out: &mut Trajectory) -> f64 {
        self.fly_with(out, |step, _| plan[step]).1
    }

    /// Simulates the aircraft with the commands that `choose` returns. The arguments of `choose` are the step and the trajectory
    /// up to this step. Writes the trajectory to `out`, and returns the commands as a plan with its cost.
    pub fn fly_with(
        &self,
        out: &mut Trajectory,
        mut choose: impl FnMut(usize, &Trajectory) -> Surfaces,
    ) -> ([Surfaces; STEPS], f64) {
        self.fly_choosing(out, |step, _, trajectory| choose(step, trajectory))
    }

    /// Simulates the aircraft under the LQI. Writes the trajectory to `out`, and returns the LQI's commands as a plan with its
    /// cost.
    pub fn follow(&self, ahead: &Ahead, out: &mut Trajectory) -> ([Surfaces; STEPS], f64) {
        let figures = &self.model.airframe.actuators;
        let mut reference = ahead.reference();
        self.fly_choosing(out, |step, flight, _| {
            let z = flight.actuators.observed(figures);
            let c = ahead.command(step, &mut reference, &flight.state, &z, &flight.previous);
            [c.aileron, c.elevator]
        })
    }

    /// Simulates the aircraft under the policy (a trained network) `actor`. Writes the trajectory to `out`, and returns the
    /// policy's commands as a plan with its cost.
    pub fn follow_policy(
        &self,
        actor: &Actor,
        units: &mut Units<f32>,
        target: &Target,
        out: &mut Trajectory,
    ) -> ([Surfaces; STEPS], f64) {
        let figures = &self.model.airframe.actuators;
        self.fly_choosing(out, |_, flight, _| {
            let observed = observe(&flight.state, &flight.actuators.observed(figures), target);
            let [aileron, elevator, _] = actor.act_one(units, &observed.map(|x| x as f32));
            [f64::from(aileron), f64::from(elevator)]
        })
    }

    fn fly_choosing(
        &self,
        out: &mut Trajectory,
        mut choose: impl FnMut(usize, &Flight, &Trajectory) -> Surfaces,
    ) -> ([Surfaces; STEPS], f64) {
        let mut flight = self.start();
        let mut plan = [[0.0; 2]; STEPS];
        let mut cost = 0.0;
        self.note(&flight, 0, out);
        for (step, place) in plan.iter_mut().enumerate() {
            let (before, from) = (flight.previous[0], flight.state);
            let chosen = choose(step, &flight, out).map(|x| x.clamp(-1.0, 1.0));
            *place = chosen;
            self.advance(&mut flight, chosen);
            self.note(&flight, step + 1, out);
            let moved = [chosen[0] - before.aileron, chosen[1] - before.elevator];
            let size = self.settings.moves;
            cost += 0.5 * (moved[0] * moved[0] + moved[1] * moved[1]) / (size * size);
            let last = step + 1 == STEPS;
            cost +=
                self.stage(&flight.state, step + 1) * if last { self.settings.last } else { 1.0 };
            cost += self.load(&from, &flight.state).value;
        }
        (plan, cost)
    }

    /// Cost terms of the state `s` after `step` steps. Each term depends on one component of the state; its index is given.
    fn costs(&self, s: &State, step: usize) -> [(usize, Cost); 7] {
        let [mut p, mut q, mut r, _, beta] = self.goal.steady;
        let point = self.course.at(step);
        if self.approach.is_some() {
            [p, q, r] = self.course.turning(step);
        }
        let turn = wrapped(s.roll - point.attitude[0]);
        let of = self.settings;
        let incidence = match (&self.bounds, &of.envelope) {
            (Some(bounds), Some(barrier)) => beyond(s.alpha, bounds.alpha, barrier.alpha),
            _ => beyond(s.alpha, [f64::NEG_INFINITY, STALL[0]], STALL[1]),
        };
        let mut sideslip = square(s.beta - beta, of.sideslip);
        if let (Some(bounds), Some(barrier)) = (&self.bounds, &of.envelope) {
            sideslip += beyond(s.beta, [-bounds.sideslip, bounds.sideslip], barrier.sideslip);
        }
        [
            (0, attitude(turn, self.approach.map_or(of.attitude, |a| a.roll), of.far)),
            (1, attitude(s.pitch - point.attitude[1], of.attitude, of.far)),
            (3, square(s.p - p, of.rate)),
            (4, square(s.q - q, of.rate)),
            (5, square(s.r - r, of.rate)),
            (6, incidence),
            (7, sideslip),
        ]
    }

    fn stage(&self, state: &State, step: usize) -> f64 {
        self.costs(state, step).iter().map(|(_, cost)| cost.value).sum()
    }

    /// Cost of the load factor's excess over its limits in the step from one state to the next.
    fn load(&self, from: &State, to: &State) -> Cost {
        match (&self.bounds, &self.settings.envelope) {
            (Some(bounds), Some(barrier)) => {
                beyond(load_factor(from, to), bounds.load, barrier.load)
            }
            _ => Cost::NONE,
        }
    }

    /// Cost of the load factor in `step`, and the gradient of the load factor with respect to the state before the step.
    /// `transition` is the linearised step. `None` if the cost is zero.
    pub fn load_terms(
        &self,
        trajectory: &Trajectory,
        step: usize,
        transition: &Transition,
    ) -> Option<(Cost, Vector)> {
        let (from, to) = (&trajectory.states[step], &trajectory.states[step + 1]);
        let cost = self.load(from, to);
        if cost.value == 0.0 {
            return None;
        }
        let [own, next] = load_factor_slopes(from, to);
        let mut slope = Vector::zeros();
        slope.as_mut_slice()[..8].copy_from_slice(&own);
        for (row, by) in next.into_iter().enumerate().filter(|(_, by)| *by != 0.0) {
            transition.add_row(row, by, &mut slope);
        }
        Some((cost, slope))
    }

    /// Gradient of the cost of the state after `step` steps, and the diagonal of its Gauss–Newton Hessian.
    pub fn stage_terms(&self, trajectory: &Trajectory, step: usize) -> (Vector, Vector) {
        let (mut slope, mut curvature) = (Vector::zeros(), Vector::zeros());
        let weight = if step == STEPS { self.settings.last } else { 1.0 };
        for (at, cost) in self.costs(&trajectory.states[step], step) {
            slope[at] += weight * cost.slope;
            curvature[at] += weight * cost.curvature;
        }
        (slope, curvature)
    }

    /// For each surface: the index of its last commanded deflection in the state vector `x`, and its deflection (rad) at full
    /// command to the side of that commanded deflection.
    pub fn last_commands(&self, x: &Vector) -> [(usize, f64); 2] {
        let figures = &self.model.airframe.actuators;
        let travels = [figures.aileron.travel, figures.elevator.travel];
        std::array::from_fn(|i| (SURFACES[i] + 2, travels[i].slope(x[SURFACES[i] + 2])))
    }

    /// Second derivative of the cost with respect to the change of a command from one step to the next.
    pub fn move_weight(&self) -> f64 {
        1.0 / (self.settings.moves * self.settings.moves)
    }

    /// The transition of the aircraft and its actuators from `step` to the next step, linearised about the trajectory.
    pub fn linear(&self, trajectory: &Trajectory, step: usize) -> Transition {
        let figures = &self.model.airframe.actuators;
        let (state, controls) = (&trajectory.states[step], &trajectory.controls[step]);
        let linear = linearise_step(self.model, state, controls, self.seen.altitude);
        let mut aircraft = SMatrix::<f64, 8, 10>::zeros();
        aircraft.fixed_columns_mut::<8>(0).copy_from(&linear.a);
        aircraft.fixed_columns_mut::<2>(8).copy_from(&linear.b.fixed_columns::<2>(0));
        let filters = std::array::from_fn(|surface| {
            let of = [&figures.aileron, &figures.elevator][surface];
            let [deflection, _, commanded, _] = trajectory.filters[step + 1][surface];
            Filter::new(of, deflection, commanded)
        });
        Transition { aircraft, filters }
    }
}
