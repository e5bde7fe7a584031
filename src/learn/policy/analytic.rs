//! The analytic policy gradient: the slope of the reward through the model, over short windows.
//!
//! The short-horizon actor-critic of Xu et al. (2022) without its critic: the windows are longer than
//! the aircraft takes to answer, so that what lies behind them adds little. The model's slopes are
//! differences between the lanes of one block: the point itself in the first, one number moved a little in
//! each of the others. The actuators are those that the five observed numbers and the last commands
//! explain, which is exact but for the first step off a stop.

use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;

use crate::control::Target;
use crate::control::policy::{ACTIONS, Actor, OBSERVATIONS, command, observe};
use crate::control::task::Task;
use crate::learn::{Mlp, Optimiser};
use crate::model::block::Block;
use crate::model::{GreyBox, Memory};
use crate::num::dense::{DenseError, Units};
use crate::num::{Dense, Dual, Real, stream};
use crate::physics::actuators::Actuators;
use crate::physics::{ActuatorState, Command, Controls, State};
use crate::sim::targets::Stratified;

/// Numbers of an aircraft: state, actuators, last commands, the integrator's memory.
const NUMBERS: usize = 8 + 5 + 5 + 3;
/// Those with an action.
const INPUTS: usize = NUMBERS + ACTIONS;

/// What an actor is trained by.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AnalyticRecipe {
    /// Units of the actor's hidden layers.
    pub actor: Vec<usize>,
    /// Aircraft at once.
    pub instances: usize,
    /// Steps of a window.
    pub window: usize,
    /// Steps of an episode.
    pub episode: usize,
    /// Updates in all.
    pub updates: u64,
    /// Learning rate at the start; it falls with a cosine to a hundredth.
    pub rate: f64,
    /// Error of roll and pitch (rad) below which the reward is rounded off: its corner has no slope.
    pub rounding: f64,
    /// Reward of a change of the command from step to step, in units of the action, negative.
    pub effort: f64,
    /// Part of the targets that lie in the hard corners.
    pub corners: f64,
    /// Models, drawn from the widths of the coefficients, over which the aircraft are spread (domain randomisation);
    /// none: the model itself.
    #[serde(default, skip_serializing_if = "is_none")]
    pub draws: u64,
    /// Seed of everything random.
    pub seed: u64,
}

fn is_none(draws: &u64) -> bool {
    *draws == 0
}

impl Default for AnalyticRecipe {
    fn default() -> Self {
        AnalyticRecipe {
            actor: vec![128, 128],
            instances: 32,
            window: 100,
            episode: 500,
            updates: 2_000,
            rate: 1e-3,
            rounding: 0.005,
            effort: 0.0,
            corners: 0.3,
            draws: 0,
            seed: 1,
        }
    }
}

/// An aircraft with all that decides how it goes on.
#[derive(Clone, Copy, Debug)]
struct Aircraft<R = f64> {
    state: State<R>,
    actuators: ActuatorState<R>,
    previous: [Command<R>; 2],
    memory: Memory<R>,
}

/// An instance: an aircraft with its target, in an episode.
#[derive(Clone, Debug)]
struct Instance {
    aircraft: Aircraft,
    target: Target,
    left: usize,
}

/// One step of an instance as its slopes: of what comes next by what was, and of the reward by what comes
/// next.
struct Step {
    next: [[f32; INPUTS]; NUMBERS],
    reward: [f32; NUMBERS],
}

/// What the model's step depends on with how far it is moved: the place among the numbers of an aircraft,
/// and the distance (rad, m/s, rad/s, throttle, m/s²).
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

/// What the steps of all instances have in common; any core may fly them.
#[derive(Clone, Copy)]
struct Flyer<'a> {
    model: &'a GreyBox,
    recipe: &'a AnalyticRecipe,
}

/// What an update saw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalyticProgress {
    /// Updates made.
    pub update: u64,
    /// Mean reward of a step.
    pub reward: f64,
    /// Aircraft lost so far.
    pub lost: u64,
}

/// A training under way.
pub struct AnalyticTrainer {
    recipe: AnalyticRecipe,
    /// The model of each aircraft, in turn.
    models: Vec<GreyBox>,
    device: Device,
    actor: Mlp,
    optimiser: Optimiser,
    targets: Stratified,
    instances: Vec<Instance>,
    neutral: Aircraft,
    update: u64,
    lost: u64,
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

    /// Reads every number as another kind, with its place.
    fn map<S: Real>(self, mut f: impl FnMut(usize, R) -> S) -> Aircraft<S> {
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

    fn observe(&self, target: &Target<R>) -> [R; OBSERVATIONS] {
        observe(&self.state, &self.actuators, target)
    }
}

impl AnalyticTrainer {
    /// A training in `model`.
    ///
    /// # Errors
    /// If the actor's layers cannot be evaluated.
    pub fn new(recipe: AnalyticRecipe, model: GreyBox) -> Result<Self, DenseError> {
        let device = Device::flex();
        let sizes = [&[OBSERVATIONS], &recipe.actor[..], &[ACTIONS]].concat();
        let mut network = Dense::uniform(&sizes, &mut stream::stream(recipe.seed, &[30]))?;
        let last = recipe.actor.last().map_or(0, |n| (n + 1) * ACTIONS);
        let first = network.parameters().len() - last;
        network.parameters_mut()[first..].iter_mut().for_each(|p| *p *= 0.1);
        let actor = Mlp::new(&network, &device);
        let mut memory = Memory::default();
        let (start, altitude) = (model.airframe.start(), model.airframe.reference.altitude);
        model.step(&start, &Controls::default(), altitude, &mut memory);
        let neutral = Aircraft {
            state: start,
            actuators: ActuatorState::default(),
            previous: [Command::IDLE; 2],
            memory,
        };
        let mut targets =
            Stratified::new(recipe.seed, 0, recipe.corners).at_airspeeds_of(&model.airframe);
        let instances = (0..recipe.instances)
            .map(|k| {
                // ends spread over time, so that no window holds all starts
                let left = recipe.episode * (k + 1) / recipe.instances;
                Instance { aircraft: neutral, target: targets.next_target(), left }
            })
            .collect();
        let models = match recipe.draws {
            0 => vec![model],
            draws => (0..draws).map(|k| model.drawn(recipe.seed, k)).collect(),
        };
        Ok(AnalyticTrainer {
            optimiser: Optimiser::new(&actor, recipe.rate),
            recipe,
            models,
            device,
            actor,
            targets,
            instances,
            neutral,
            update: 0,
            lost: 0,
        })
    }

    /// The same training from the weights of `actor`, whose layers must be those of the recipe.
    ///
    /// # Errors
    /// If they are not.
    pub fn starting_from(mut self, actor: &Actor) -> Result<Self, DenseError> {
        let sizes = actor.network().sizes();
        if sizes != self.actor.sizes() {
            return Err(DenseError::Sizes(sizes.to_vec()));
        }
        self.actor = Mlp::new(actor.network(), &self.device);
        self.optimiser = Optimiser::new(&self.actor, self.recipe.rate);
        Ok(self)
    }

    /// The actor as it is now.
    ///
    /// # Errors
    /// If a parameter is no longer finite.
    pub fn actor(&self) -> Result<Actor, DenseError> {
        let sizes = self.actor.sizes().to_vec();
        Actor::new(self.actor.to_dense()?).map_err(|_| DenseError::Sizes(sizes))
    }

    /// One window of every instance and one update.
    ///
    /// # Errors
    /// If a parameter is no longer finite.
    pub fn update(&mut self) -> Result<AnalyticProgress, DenseError> {
        let actor = self.actor()?;
        let (count, window) = (self.instances.len(), self.recipe.window);
        let mut seen = vec![[0.0_f32; OBSERVATIONS]; count * window];
        let mut steps: Vec<Option<Step>> = Vec::with_capacity(count * window);
        let mut reward = 0.0;
        // forward: step after step; the instances of a step are shared by the cores
        let mut flown = Vec::with_capacity(count);
        for t in 0..window {
            let fly = |units: &mut Units<f32>, (k, instance): (usize, &Instance)| {
                let Instance { aircraft, target, .. } = instance;
                let model = &self.models[k % self.models.len()];
                let flyer = Flyer { model, recipe: &self.recipe };
                let observed = aircraft.observe(target).map(|x| x as f32);
                let action = actor.act_one(units, &observed);
                (observed, flyer.slopes(aircraft, target, action.map(f64::from)))
            };
            self.instances
                .par_iter()
                .enumerate()
                .with_min_len(8)
                .map_init(|| Units::new(0.0), fly)
                .collect_into_vec(&mut flown);
            // the order of targets and sums is that of one core
            for (k, (observed, (next, step, earned))) in flown.drain(..).enumerate() {
                seen[t * count + k] = observed;
                reward += earned / (count * window) as f64;
                steps.push(self.advance(k, next).then_some(step));
            }
        }
        let slopes = self.reverse(&seen, &steps);
        self.climb(&seen, &slopes);
        self.update += 1;
        Ok(AnalyticProgress { update: self.update, reward, lost: self.lost })
    }

    /// Puts an instance into its next step; `false` if its episode ended there.
    fn advance(&mut self, k: usize, next: Aircraft) -> bool {
        let State { pitch, airspeed, alpha, beta, p, q, r, .. } = next.state;
        let inside = pitch.abs() < 1.4
            && (5.0..60.0).contains(&airspeed)
            && alpha.abs() < 0.8
            && beta.abs() < 0.8
            && [p, q, r].iter().all(|x| x.abs() < 20.0);
        let instance = &mut self.instances[k];
        instance.aircraft = next;
        instance.left = instance.left.saturating_sub(1);
        if inside && instance.left > 0 {
            return true;
        }
        self.lost += u64::from(!inside);
        let target = self.targets.next_target();
        *instance = Instance { aircraft: self.neutral, target, left: self.recipe.episode };
        false
    }

    /// Backward through the windows: the slope of the sum of rewards by every action.
    fn reverse(&self, seen: &[[f32; OBSERVATIONS]], steps: &[Option<Step>]) -> Vec<f32> {
        let count = self.instances.len();
        let actor = self.actor.passed();
        let mut slopes = vec![0.0_f32; steps.len() * ACTIONS];
        let mut behind = vec![[0.0_f32; NUMBERS]; count];
        let observation = observation_slopes();
        for t in (0..self.recipe.window).rev() {
            let range = t * count..(t + 1) * count;
            let mut of_action = vec![0.0_f32; count * ACTIONS];
            let mut before = vec![[0.0_f32; NUMBERS]; count];
            for (k, step) in steps[range.clone()].iter().enumerate() {
                // what follows the end of an episode is another one's
                let Some(step) = step else { continue };
                let mut sum = [0.0_f32; INPUTS];
                for ((row, behind), reward) in step.next.iter().zip(behind[k]).zip(step.reward) {
                    sum.iter_mut().zip(row).for_each(|(s, x)| *s += (behind + reward) * x);
                }
                before[k].copy_from_slice(&sum[..NUMBERS]);
                of_action[k * ACTIONS..][..ACTIONS].copy_from_slice(&sum[NUMBERS..]);
            }
            slopes[t * count * ACTIONS..][..count * ACTIONS].copy_from_slice(&of_action);
            // through the actor: what it saw then decided what it did
            let rows =
                self.rows(seen[range].as_flattened(), OBSERVATIONS).autodiff().require_grad();
            let weights = self.rows(&of_action, ACTIONS).autodiff();
            let sum = (actor.forward(rows.clone()).tanh() * weights).sum();
            let mut gradients = sum.backward();
            let through = rows.grad_remove(&mut gradients).map(|g| g.into_data());
            if let Some(Ok(through)) = through.map(|data| data.try_into_vec::<f32>()) {
                for (before, through) in before.iter_mut().zip(through.chunks_exact(OBSERVATIONS)) {
                    for (o, (place, factor)) in observation.iter().enumerate() {
                        before[*place] += factor * through[o];
                    }
                }
            }
            behind = before;
        }
        slopes
    }

    /// Moves the actor up the slopes.
    fn climb(&mut self, seen: &[[f32; OBSERVATIONS]], slopes: &[f32]) {
        let followed = self.actor.followed();
        let rows = self.rows(seen.as_flattened(), OBSERVATIONS).autodiff();
        let scale = 1.0 / self.instances.len() as f64;
        let weights = self.rows(slopes, ACTIONS).autodiff() * scale;
        let loss = -(followed.forward(rows).tanh() * weights).sum();
        let mut gradients = loss.backward();
        let part = self.update as f64 / self.recipe.updates.max(1) as f64;
        let fall = 0.5 * (1.0 + (std::f64::consts::PI * part.min(1.0)).cos());
        self.optimiser.set_rate(self.recipe.rate * (0.01 + 0.99 * fall));
        self.optimiser.step(&mut self.actor, followed, &mut gradients);
    }

    fn rows(&self, numbers: &[f32], width: usize) -> Tensor<2> {
        let data = TensorData::new(numbers.to_vec(), [numbers.len() / width, width]);
        Tensor::from_data(data, &self.device)
    }
}

impl Flyer<'_> {
    /// A step with its slopes, and the reward of eq. (30).
    fn slopes(
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

    /// State and memory a step later; their slopes go into `next`.
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
                // by what it really moved in single precision; a memory that the scheme does not have does not
                let distance = before[*place].0[k + 1] - before[*place].0[0];
                if distance != 0.0 {
                    next[row][*place] = (all[row].0[k + 1] - all[row].0[0]) / distance;
                }
            }
        }
        after.map(|_, x| x.0[0].into())
    }

    /// Actuators and last commands a step later; their slopes go into `next`.
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

    /// The slope of the reward of eq. (30) by what came next, with two changes: it is rounded off next to
    /// the target, and past a cap a tenth of the slope is left, so that there is a way back.
    fn reward(&self, next: &Aircraft, target: &Target) -> [f32; NUMBERS] {
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

/// Of each observation the number of the aircraft that it depends on, with its slope: each depends on one.
fn observation_slopes() -> [(usize, f32); OBSERVATIONS] {
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
