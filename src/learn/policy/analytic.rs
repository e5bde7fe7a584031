//! The analytic policy gradient: the gradient of the reward through the model, over short windows.
//!
//! This is the short-horizon actor-critic of Xu et al. (2022) without its critic. The windows are longer than the
//! response time of the aircraft, so the rewards after a window matter little. The model's derivatives are finite
//! differences between the lanes of SIMD vectors. The first lane holds the point itself, and each other lane has one
//! perturbed variable. The actuator states are reconstructed from the five observed values and the last commands. The
//! reconstruction is exact except for the first step after an actuator leaves a stop.

mod slopes;

use std::ops::Range;

use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;

use crate::{Mlp, Optimiser};
use greylag_control::Target;
use greylag_control::policy::{ACTIONS, Actor, OBSERVATIONS};
use greylag_model::{GreyBox, Memory};
use greylag_num::dense::{DenseError, Units};
use greylag_num::{Dense, stream};
use greylag_physics::{ActuatorState, Command, Controls, State};
use greylag_sim::targets::Stratified;
use slopes::{Aircraft, Flyer, INPUTS, NUMBERS, Step, observation_slopes};

/// Airspeeds between which an aircraft is not lost, as fractions of the smallest and the largest airspeed of its envelope: 5 and
/// 60 m/s for the X8, with which the shipped policies were trained.
const AIRSPEED: [f64; 2] = [5.0 / 13.0, 4.0 / 3.0];

/// Settings of the training.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AnalyticRecipe {
    /// Number of units of each hidden layer of the actor.
    pub actor: Vec<usize>,
    /// Number of simulated aircraft.
    pub instances: usize,
    /// Number of steps of a window.
    pub window: usize,
    /// Number of steps of an episode.
    pub episode: usize,
    /// Total number of updates.
    pub updates: u64,
    /// Initial learning rate. A cosine schedule reduces it to a hundredth.
    pub rate: f64,
    /// Error of roll or pitch (rad) or airspeed (m/s) below which the reward is smoothed. Without smoothing the reward
    /// is not differentiable at zero error.
    pub rounding: f64,
    /// Weight (≥ 0) of the squared change of the aileron and elevator commands per step in the objective. Commands
    /// range from −1 to 1.
    pub effort: f64,
    /// Fraction of the targets in the corners of the target range (bank of 45° to 60° with pitch of 25° to 30°),
    /// 0..1.
    pub corners: f64,
    /// Number of models whose coefficients are drawn from their standard deviations (domain randomisation). The
    /// aircraft are distributed over these models. 0 means that all aircraft use the model itself.
    #[serde(default, skip_serializing_if = "is_none")]
    pub draws: u64,
    /// Seed of all random numbers.
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

/// A simulated aircraft in an episode, with its target and the number of steps left.
#[derive(Clone, Debug)]
struct Instance {
    aircraft: Aircraft,
    target: Target,
    left: usize,
}

/// Progress of an update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalyticProgress {
    /// Number of updates made.
    pub update: u64,
    /// Mean reward per step in the window of this update.
    pub reward: f64,
    /// Number of episodes so far that ended early because the state of the aircraft became implausible.
    pub lost: u64,
}

/// State of a training.
pub struct AnalyticTrainer {
    recipe: AnalyticRecipe,
    /// The models to which the aircraft are assigned in turn.
    models: Vec<GreyBox>,
    /// Airspeeds outside of which an aircraft is lost, m/s.
    airspeeds: Range<f64>,
    device: Device,
    actor: Mlp,
    optimiser: Optimiser,
    targets: Stratified,
    instances: Vec<Instance>,
    neutral: Aircraft,
    update: u64,
    lost: u64,
}

impl AnalyticTrainer {
    /// A training in `model`.
    ///
    /// # Errors
    ///
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
                // The ends of the episodes are spread over time. Otherwise one window would contain all starts.
                let left = recipe.episode * (k + 1) / recipe.instances;
                Instance { aircraft: neutral, target: targets.next_target(), left }
            })
            .collect();
        let ([slow, fast], envelope) = (AIRSPEED, &model.airframe.envelope);
        let airspeeds = slow * envelope.airspeed_min_mps..fast * envelope.airspeed_max_mps;
        let models = match recipe.draws {
            0 => vec![model],
            draws => (0..draws).map(|k| model.drawn(recipe.seed, k)).collect(),
        };
        Ok(AnalyticTrainer {
            optimiser: Optimiser::new(&actor, recipe.rate),
            recipe,
            models,
            airspeeds,
            device,
            actor,
            targets,
            instances,
            neutral,
            update: 0,
            lost: 0,
        })
    }

    /// Starts this training from the weights of `actor`, whose layers must be those of the recipe.
    ///
    /// # Errors
    ///
    /// If the layers differ from those of the recipe.
    pub fn starting_from(mut self, actor: &Actor) -> Result<Self, DenseError> {
        let sizes = actor.network().sizes();
        if sizes != self.actor.sizes() {
            return Err(DenseError::Sizes(sizes.to_vec()));
        }
        self.actor = Mlp::new(actor.network(), &self.device);
        self.optimiser = Optimiser::new(&self.actor, self.recipe.rate);
        Ok(self)
    }

    /// The present actor.
    ///
    /// # Errors
    ///
    /// If a parameter is not finite.
    pub fn actor(&self) -> Result<Actor, DenseError> {
        let sizes = self.actor.sizes().to_vec();
        Actor::new(self.actor.to_dense()?).map_err(|_| DenseError::Sizes(sizes))
    }

    /// Simulates one window of every aircraft and updates the actor once.
    ///
    /// # Errors
    ///
    /// If a parameter is not finite.
    pub fn update(&mut self) -> Result<AnalyticProgress, DenseError> {
        let actor = self.actor()?;
        let (count, window) = (self.instances.len(), self.recipe.window);
        let mut seen = vec![[0.0_f32; OBSERVATIONS]; count * window];
        let mut steps: Vec<Option<Step>> = Vec::with_capacity(count * window);
        let mut reward = 0.0;
        // Forward pass, step by step. The instances of a step are distributed over the cores.
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
            // one thread draws the targets and sums the rewards: the result does not depend on the number of cores
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

    /// Advances aircraft `k` to its state `next`. Returns `false` if its episode ended there.
    fn advance(&mut self, k: usize, next: Aircraft) -> bool {
        let State { pitch, airspeed, alpha, beta, p, q, r, .. } = next.state;
        let inside = pitch.abs() < 1.4
            && self.airspeeds.contains(&airspeed)
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

    /// Backward pass: the derivative of the sum of rewards with respect to every action, in the order of `steps`.
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
                // an episode ended here: the later steps belong to another episode
                let Some(step) = step else { continue };
                let mut sum = [0.0_f32; INPUTS];
                for ((row, behind), reward) in step.next.iter().zip(behind[k]).zip(step.reward) {
                    sum.iter_mut().zip(row).for_each(|(s, x)| *s += (behind + reward) * x);
                }
                before[k].copy_from_slice(&sum[..NUMBERS]);
                of_action[k * ACTIONS..][..ACTIONS].copy_from_slice(&sum[NUMBERS..]);
            }
            slopes[t * count * ACTIONS..][..count * ACTIONS].copy_from_slice(&of_action);
            // gradient through the actor: its action depends on the observation
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

    /// Updates the actor by gradient ascent on the reward. `slopes` are the derivatives from `reverse`.
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
