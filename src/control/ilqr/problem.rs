//! What a plan costs: rollout, cost and their derivatives.

use nalgebra::{SMatrix, SVector};

use super::{STEPS, Surfaces};
use crate::Observation;
use crate::lqi::{Ahead, Goal};
use greylag_model::{GreyBox, Memory, STEP, linearise_step};
use greylag_physics::actuators::Actuators;
use greylag_physics::inputs::InputMemory;
use greylag_physics::{Command, Controls, State};

/// States: those of eq. (4), then for aileron and elevator the deflection now and one step ago with the
/// two last commanded deflections, rad.
pub(super) const STATES: usize = 16;

/// Places of the deflections and of the last commanded ones.
const SURFACES: [usize; 2] = [8, 12];

/// A matrix over the states.
pub(super) type Square = SMatrix<f64, STATES, STATES>;
/// A vector over the states.
pub(super) type Vector = SVector<f64, STATES>;
/// How commands act.
pub(super) type Input = SMatrix<f64, STATES, 2>;

// What is as bad as the others' (Bryson). Of a few tried on every seventh target these settle as soon as any
// and are the steadiest in moderate turbulence.
/// Attitude error, rad.
const ATTITUDE: f64 = 0.05;
/// Body rates beside those of the steady turn, rad/s.
const RATE: f64 = 2.0;
/// Sideslip beside the steady one, rad.
const SIDESLIP: f64 = 0.3;
/// A step of the command, in units of the largest deflection.
const MOVE: f64 = 0.3;
/// Incidence (rad) above which it costs, and its excess that is as bad.
const STALL: [f64; 2] = [0.16, 0.02];
/// What the last state costs, in stages.
const LAST: f64 = 20.0;

/// One tick's problem.
#[derive(Clone, Copy, Debug)]
pub(super) struct Problem<'a> {
    pub model: &'a GreyBox,
    pub seen: &'a Observation,
    pub goal: Goal,
    /// Throttle all along, 0..1.
    pub throttle: f64,
    /// Rudder command all along: the LQI's.
    pub rudder: f64,
    pub memory: Memory,
    /// What the state's rate has beside the model's.
    pub disturbance: State,
}

/// States and surfaces along a plan.
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

    /// The difference of two trajectories at a step.
    pub fn less(&self, other: &Trajectory, step: usize) -> Vector {
        self.at(step) - other.at(step)
    }

    /// The state at a step.
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

/// An aircraft on its way along a plan.
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

    /// Writes where `flight` is.
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

    /// Flies a plan; what it costs.
    pub fn fly(&self, plan: &[Surfaces; STEPS], out: &mut Trajectory) -> f64 {
        self.fly_with(out, |step, _| plan[step]).1
    }

    /// Flies what `choose` says at each step, given the trajectory up to there; the plan and its cost.
    pub fn fly_with(
        &self,
        out: &mut Trajectory,
        mut choose: impl FnMut(usize, &Trajectory) -> Surfaces,
    ) -> ([Surfaces; STEPS], f64) {
        self.fly_choosing(out, |step, _, trajectory| choose(step, trajectory))
    }

    /// Flies the LQI's own way on; its plan and what that costs.
    pub fn follow(&self, ahead: &Ahead, out: &mut Trajectory) -> ([Surfaces; STEPS], f64) {
        let figures = &self.model.airframe.actuators;
        let mut reference = ahead.reference();
        self.fly_choosing(out, |step, flight, _| {
            let z = flight.actuators.observed(figures);
            let c = ahead.command(step, &mut reference, &flight.state, &z, &flight.previous);
            [c.aileron, c.elevator]
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
            let before = flight.previous[0];
            let chosen = choose(step, &flight, out).map(|x| x.clamp(-1.0, 1.0));
            *place = chosen;
            self.advance(&mut flight, chosen);
            self.note(&flight, step + 1, out);
            let moved = [chosen[0] - before.aileron, chosen[1] - before.elevator];
            cost += 0.5 * (moved[0] * moved[0] + moved[1] * moved[1]) / (MOVE * MOVE);
            cost += self.stage(&flight.state) * if step + 1 == STEPS { LAST } else { 1.0 };
        }
        (plan, cost)
    }

    /// Each weighed residual of a state, with its place in the state; stall only where there is any.
    fn residuals(&self, s: &State) -> [(usize, f64, f64); 7] {
        let [p, q, r, _, beta] = self.goal.steady;
        let tau = std::f64::consts::TAU;
        let turn = (s.roll - self.goal.attitude[0] + tau / 2.0).rem_euclid(tau) - tau / 2.0;
        let stall = (s.alpha - STALL[0]).max(0.0);
        [
            (0, turn, 1.0 / ATTITUDE),
            (1, s.pitch - self.goal.attitude[1], 1.0 / ATTITUDE),
            (3, s.p - p, 1.0 / RATE),
            (4, s.q - q, 1.0 / RATE),
            (5, s.r - r, 1.0 / RATE),
            (6, stall, if stall > 0.0 { 1.0 / STALL[1] } else { 0.0 }),
            (7, s.beta - beta, 1.0 / SIDESLIP),
        ]
    }

    fn stage(&self, state: &State) -> f64 {
        self.residuals(state).iter().map(|(_, x, w)| 0.5 * (x * w) * (x * w)).sum()
    }

    /// Slope and curvature of what the state costs after `step` steps.
    pub fn stage_terms(&self, trajectory: &Trajectory, step: usize) -> (Vector, Vector) {
        let (mut slope, mut curvature) = (Vector::zeros(), Vector::zeros());
        let weight = if step == STEPS { LAST } else { 1.0 };
        for (at, x, w) in self.residuals(&trajectory.states[step]) {
            slope[at] += weight * w * w * x;
            curvature[at] += weight * w * w;
        }
        (slope, curvature)
    }

    /// Where in the state `x` the last commanded surfaces stand, with the deflection (rad) that a
    /// command of one asks for on their side.
    pub fn last_commands(&self, x: &Vector) -> [(usize, f64); 2] {
        let figures = &self.model.airframe.actuators;
        let travels = [figures.aileron.travel, figures.elevator.travel];
        std::array::from_fn(|i| (SURFACES[i] + 2, travels[i].slope(x[SURFACES[i] + 2])))
    }

    /// Weight of a squared step of the command.
    pub fn move_weight(&self) -> f64 {
        1.0 / (MOVE * MOVE)
    }

    /// One step, linear about the trajectory: δx₊ = a δx + b δu.
    pub fn linear(&self, trajectory: &Trajectory, step: usize) -> (Square, Input) {
        let figures = &self.model.airframe.actuators;
        let (state, controls) = (&trajectory.states[step], &trajectory.controls[step]);
        let linear = linearise_step(self.model, state, controls, self.seen.altitude);
        let mut a = Square::zeros();
        let mut b = Input::zeros();
        a.fixed_view_mut::<8, 8>(0, 0).copy_from(&linear.a);
        for (surface, at) in SURFACES.into_iter().enumerate() {
            let of = [&figures.aileron, &figures.elevator][surface];
            let [b0, a1, a2] = of.filter;
            let [deflection, _, commanded, _] = trajectory.filters[step + 1][surface];
            let unit = of.travel.slope(commanded);
            a.fixed_view_mut::<8, 1>(0, at).copy_from(&linear.b.column(surface));
            let (before, input, input_before) = (at + 1, at + 2, at + 3);
            // a surface at its stop stays there
            let free = of.travel.reaches(deflection);
            if free {
                a[(at, at)] = -a1;
                a[(at, before)] = -a2;
                a[(at, input)] = 2.0 * b0;
                a[(at, input_before)] = b0;
                b[(at, surface)] = b0 * unit;
            }
            a[(before, at)] = 1.0;
            b[(input, surface)] = unit;
            a[(input_before, input)] = 1.0;
        }
        (a, b)
    }
}
