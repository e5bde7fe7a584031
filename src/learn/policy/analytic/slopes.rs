//! One step of a simulated aircraft with its derivatives, for the analytic policy gradient. These are the derivatives of the next
//! state with respect to state and action, and the derivative of the reward.

use super::AnalyticRecipe;
use greylag_control::Target;
use greylag_control::policy::{ACTIONS, OBSERVATIONS, command, observe};
use greylag_control::task::Task;
use greylag_model::block::Block;
use greylag_model::{GreyBox, Memory};
use greylag_num::{Dual, Real};
use greylag_physics::actuators::Actuators;
use greylag_physics::{ActuatorState, Command, State};

/// Number of variables of an aircraft: state (8), actuators (5), last two commands (5), last acceleration in the integrator (3).
pub(super) const NUMBERS: usize = 8 + 5 + 5 + 3;
/// Number of inputs of a step: the variables of an aircraft and the components of an action.
pub(super) const INPUTS: usize = NUMBERS + ACTIONS;

/// An aircraft with all variables that determine its next step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aircraft<R = f64> {
    pub(super) state: State<R>,
    pub(super) actuators: ActuatorState<R>,
    pub(super) previous: [Command<R>; 2],
    pub(super) memory: Memory<R>,
}

/// Derivatives of one step of an aircraft. `next` has the derivatives of the next variables (row) with respect to the present
/// variables and the action (column). `reward` has those of the reward with respect to the next variables.
pub(super) struct Step {
    pub(super) next: [[f32; INPUTS]; NUMBERS],
    pub(super) reward: [f32; NUMBERS],
}

/// Variables that are perturbed for finite differences of the model's step. Each entry has the index of a variable in an
/// [`Aircraft`] and its perturbation (rad, m/s, rad/s, throttle 0..1, m/s²).
const MOVED: [(usize, f32); 14] = [
    (0, 2e-3),
    (1, 2e-3),
    (2, 0.05),
    (3, 0.02),
    (4, 0.02),
    (5, 0.02),
    (6, 2e-3),
    (7, 2e-3),
    (8, 5e-3),
    (10, 5e-3),
    (12, 0.01),
    (18, 0.2),
    (19, 0.2),
    (20, 0.2),
];

/// The model and the settings, which all threads share.
#[derive(Clone, Copy)]
pub(super) struct Flyer<'a> {
    pub(super) model: &'a GreyBox,
    pub(super) recipe: &'a AnalyticRecipe,
}

impl<R: Real> Aircraft<R> {
    fn to_array(self) -> [R; NUMBERS] {
        let mut all = [R::zero(); NUMBERS];
        all[..8].copy_from_slice(&self.state.to_array());
        let z = self.actuators;
        let [new, old] = self.previous;
        let rest = [
            z.aileron,
            z.aileron_rate,
            z.elevator,
            z.elevator_rate,
            z.throttle,
            new.aileron,
            new.elevator,
            new.throttle,
            old.aileron,
            old.elevator,
        ];
        all[8..18].copy_from_slice(&rest);
        let mut place = 18;
        self.memory.map(|x| {
            all[place] = x;
            place += 1;
            x
        });
        all
    }

    /// Applies `f` to the index and the value of every variable.
    pub(super) fn map<S: Real>(self, mut f: impl FnMut(usize, R) -> S) -> Aircraft<S> {
        let all = self.to_array();
        let mut at = |k: usize| f(k, all[k]);
        let state = State::from_array(std::array::from_fn(&mut at));
        let actuators = ActuatorState {
            aileron: at(8),
            aileron_rate: at(9),
            elevator: at(10),
            elevator_rate: at(11),
            throttle: at(12),
            rudder: S::zero(),
            rudder_rate: S::zero(),
        };
        let new =
            Command { aileron: at(13), elevator: at(14), throttle: at(15), rudder: S::zero() };
        let (aileron, elevator) = (at(16), at(17));
        let old = Command { aileron, elevator, throttle: S::zero(), rudder: S::zero() };
        let mut place = 18;
        let memory = self.memory.map(|x| {
            place += 1;
            f(place - 1, x)
        });
        Aircraft { state, actuators, previous: [new, old], memory }
    }

    pub(super) fn observe(&self, target: &Target<R>) -> [R; OBSERVATIONS] {
        observe(&self.state, &self.actuators, target)
    }
}

impl Flyer<'_> {
    /// Makes a step with `action`. Returns the aircraft after it, the derivatives of the step, and the reward of eq. (30).
    pub(super) fn slopes(
        &self,
        aircraft: &Aircraft,
        target: &Target,
        action: [f64; ACTIONS],
    ) -> (Aircraft, Step, f64) {
        let mut next = [[0.0; INPUTS]; NUMBERS];
        let moved = self.motion(aircraft, &mut next);
        let (actuators, previous) = self.actuation(aircraft, action, &mut next);
        let after = Aircraft { actuators, previous, ..moved };
        let earned = Task::PAPER.reward(&after.state, target);
        (after, Step { next, reward: self.reward(&after, target) }, earned)
    }

    /// The aircraft with the state and the integrator's memory after a step. Writes the derivatives of these into `next`.
    fn motion(&self, aircraft: &Aircraft, next: &mut [[f32; INPUTS]; NUMBERS]) -> Aircraft {
        let at: Aircraft<Block> = aircraft.map(|place, x| {
            let mut lanes = Block::from_f64(x);
            if let Some(k) = MOVED.iter().position(|m| m.0 == place) {
                lanes.0[k + 1] += MOVED[k].1;
            }
            lanes
        });
        let mut memory = at.memory;
        let controls = at.actuators.controls();
        let altitude = self.model.airframe.reference.altitude;
        let state = self.model.step_block(&at.state, &controls, altitude, &mut memory);
        let after = Aircraft { state, memory, ..at };
        let (before, all) = (at.to_array(), after.to_array());
        for row in (0..8).chain(18..21) {
            for (k, (place, _)) in MOVED.iter().enumerate() {
                // the perturbation after rounding to single precision; it is zero if the integration scheme has no memory
                let distance = before[*place].0[k + 1] - before[*place].0[0];
                if distance != 0.0 {
                    next[row][*place] = (all[row].0[k + 1] - all[row].0[0]) / distance;
                }
            }
        }
        after.map(|_, x| x.0[0].into())
    }

    /// The actuators and the last two commands after a step. Writes their derivatives into `next`.
    fn actuation(
        &self,
        aircraft: &Aircraft,
        action: [f64; ACTIONS],
        next: &mut [[f32; INPUTS]; NUMBERS],
    ) -> (ActuatorState, [Command; 2]) {
        type D = Dual<13>;
        let figures = &self.model.airframe.actuators;
        let at: Aircraft<D> = aircraft.map(|place, x| match place {
            8..18 => D::variable(x, place - 8),
            _ => D::from_f64(x),
        });
        let mut place = 10;
        let action = action.map(|a| {
            place += 1;
            D::variable(a, place - 1)
        });
        let mut filters = Actuators::from_observed(&at.actuators, &at.previous, figures);
        let command = command(action);
        filters.step(&command, figures);
        let after = Aircraft {
            actuators: filters.observed(figures),
            previous: [command, at.previous[0]],
            ..at
        };
        for (row, x) in after.to_array().iter().enumerate().take(18).skip(8) {
            for (k, slope) in x.gradient.iter().enumerate() {
                next[row][if k < 10 { 8 + k } else { NUMBERS + k - 10 }] = *slope as f32;
            }
        }
        let plain = after.map(|_, x| x.value);
        (plain.actuators, plain.previous)
    }

    /// The derivative of the reward of eq. (30) with respect to the next variables, with three changes. Near the target the
    /// reward is smoothed. Where a term of the reward is at its cap, a tenth of its derivative is kept, because otherwise the
    /// gradient would vanish. The derivative of the penalty on changes of the commands is added.
    pub(super) fn reward(&self, next: &Aircraft, target: &Target) -> [f32; NUMBERS] {
        let task = Task::PAPER;
        let slope = |x: f64, scale: f64, cap: f64| {
            let steep = (x / self.recipe.rounding.max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0) / scale;
            if x.abs() / scale < cap { -steep } else { -0.1 * steep }
        };
        let s = &next.state;
        let mut all = [0.0; NUMBERS];
        all[0] = slope(s.roll - target.roll, task.roll_scale, task.roll_cap);
        all[1] = slope(s.pitch - target.pitch, task.pitch_scale, task.pitch_cap);
        all[2] = slope(s.airspeed - target.airspeed, task.airspeed_scale, task.airspeed_cap);
        let [new, old] = next.previous;
        let effort = |x: f64| -2.0 * self.recipe.effort * x;
        (all[13], all[14]) =
            (effort(new.aileron - old.aileron), effort(new.elevator - old.elevator));
        (all[16], all[17]) = (-all[13], -all[14]);
        all.map(|x| x as f32)
    }
}

/// For each component of the observation, the index of the only variable of the aircraft on which it depends, and the derivative
/// with respect to that variable.
pub(super) fn observation_slopes() -> [(usize, f32); OBSERVATIONS] {
    type D = Dual<13>;
    let at = |k: usize| D::variable(0.1, k);
    let state = State::from_array(std::array::from_fn(at));
    let actuators = ActuatorState {
        aileron: at(8),
        aileron_rate: at(9),
        elevator: at(10),
        elevator_rate: at(11),
        throttle: at(12),
        rudder: D::zero(),
        rudder_rate: D::zero(),
    };
    let target = Target { roll: 0.0, pitch: 0.0, airspeed: 0.0 }.map(D::from_f64);
    observe(&state, &actuators, &target).map(|o| {
        let place = o.gradient.iter().position(|g| *g != 0.0).unwrap_or(0);
        (place, o.gradient[place] as f32)
    })
}
