//! Twin critics of a fixed actor, learned from the returns of its simulated flights.
//!
//! A planner uses the critics, also in states that the actor alone would not reach. Therefore each flight starts with random
//! actions for some steps. Then the actor flies for a fixed number of steps, the window. The return is the discounted sum of the
//! rewards from a state to the end of the window. The value of a state is its return plus the critic's discounted value of the
//! last state. This is TD(1) over a window, eq. (11) of \[GSFM26\] (see `src/lib.rs`) for a fixed actor. The loss uses errors
//! relative to the return, because returns are small near the target and a planner must resolve small differences there.

use burn::tensor::{Device, Tensor, TensorData};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use crate::{Mlp, Optimiser};
use greylag_control::policy::{ACTIONS, Actor, Critic, OBSERVATIONS, ShapeError};
use greylag_control::task::Task;
use greylag_num::dense::{DenseError, Units};
use greylag_num::stream::{self, Stream};
use greylag_num::{Dense, Real};
use greylag_sim::Trouble;
use greylag_sim::imagined::{Block, Ended, Stepped, WIDTH};
use greylag_sim::world::World;

/// Ids of the random streams.
const START: u64 = 40;
const FLY: u64 = 41;
const UPDATE: u64 = 42;

/// Number of inputs of a critic.
const INPUTS: usize = OBSERVATIONS + ACTIONS;
/// Number of values stored per step: a critic's inputs, the return over the rest of the window, the discount of the
/// value at the end of the window, and a critic's inputs at that end.
const ROW: usize = INPUTS + 2 + INPUTS;

/// The loss divides each error by the magnitude of the return plus this value, in units of the reward of eq. (30). For much
/// smaller returns the errors therefore count as absolute errors.
const SMALL: f32 = 0.1;

/// Settings of the training of critics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValuationRecipe {
    /// Number of units of each hidden layer of a critic.
    pub critic: Vec<usize>,
    /// Total number of updates.
    pub updates: u64,
    /// Number of stored steps in a minibatch.
    pub batch: usize,
    /// Initial learning rate. A cosine schedule reduces it to a hundredth.
    pub rate: f64,
    /// Number of simulated aircraft.
    pub instances: usize,
    /// Largest number of steps with random actions before a window.
    pub burst: u64,
    /// Number of steps of a window. The first action of a window is random, the others are the actor's.
    pub window: usize,
    /// Number of windows after which all episodes restart with other targets.
    pub windows: u64,
    /// Number of updates between two windows of simulated flight.
    pub between: u64,
    /// Capacity of the replay buffer, in steps.
    pub remembered: usize,
    /// Discount factor γ per step.
    pub discount: f64,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for ValuationRecipe {
    fn default() -> Self {
        ValuationRecipe {
            critic: vec![128, 128],
            updates: 20_000,
            batch: 512,
            rate: 1e-3,
            instances: 64,
            burst: 15,
            window: 80,
            windows: 4,
            between: 10,
            remembered: 500_000,
            discount: Task::PAPER.discount,
            seed: 1,
        }
    }
}

/// Reason why critics cannot be learned.
#[derive(Debug, thiserror::Error)]
pub enum ValuationError {
    /// The loss is not finite.
    #[error("the loss of the critics is not finite after {0} updates; lower --rate")]
    Loss(u64),
    /// A network cannot be used.
    #[error("the critics: {0}")]
    Network(#[from] DenseError),
    /// A network does not have a critic's shape.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The environment cannot continue.
    #[error("the world that the actor is valued in: {0}")]
    World(#[from] Trouble),
}

/// Progress of the training after a call of [`Valuation::run`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ValuationProgress {
    /// Number of updates made.
    pub updates: u64,
    /// RMS relative error of the critics' values, over the updates of this call.
    pub error: f64,
    /// Number of steps flown so far, summed over all aircraft.
    pub steps: u64,
}

/// State of the training of critics.
pub struct Valuation<W> {
    recipe: ValuationRecipe,
    world: W,
    actor: Actor,
    device: Device,
    critics: [(Mlp, Optimiser); 2],
    rows: Vec<[f32; ROW]>,
    next: usize,
    flown: u64,
    steps: u64,
    updates: u64,
    units: Units<Block>,
}

impl<W: World> Valuation<W> {
    /// Starts the training of critics of `actor` in `world`. The number of aircraft in `world` must be that of the
    /// recipe.
    ///
    /// # Errors
    ///
    /// If the critics' layers cannot be evaluated.
    pub fn new(recipe: ValuationRecipe, world: W, actor: Actor) -> Result<Self, ValuationError> {
        let device = Device::flex();
        let sizes = [&[INPUTS], &recipe.critic[..], &[1]].concat();
        let critic = |number: u64| -> Result<(Mlp, Optimiser), DenseError> {
            let mut rng = stream::stream(recipe.seed, &[START, number]);
            let network = Mlp::new(&Dense::uniform(&sizes, &mut rng)?, &device);
            let optimiser = Optimiser::new(&network, recipe.rate);
            Ok((network, optimiser))
        };
        Ok(Valuation {
            critics: [critic(0)?, critic(1)?],
            recipe,
            world,
            actor,
            device,
            rows: Vec::new(),
            next: 0,
            flown: 0,
            steps: 0,
            updates: 0,
            units: Units::new(Block::zero()),
        })
    }

    /// Makes up to `updates` further updates, within the recipe's total.
    ///
    /// # Errors
    ///
    /// If a loss is not finite or the environment fails.
    pub fn run(&mut self, updates: u64) -> Result<ValuationProgress, ValuationError> {
        let until = self.updates.saturating_add(updates).min(self.recipe.updates);
        let (mut sum, from) = (0.0, self.updates);
        while self.updates < until {
            if self.updates.is_multiple_of(self.recipe.between) {
                let blocks = self.world.instances().div_ceil(WIDTH);
                for block in 0..blocks {
                    self.fly(block)?;
                }
                self.flown += 1;
                if self.flown.is_multiple_of(self.recipe.windows) {
                    let given = self.world.targets();
                    self.world.restart(given)?;
                }
            }
            let loss = self.update()?;
            if !loss.is_finite() {
                return Err(ValuationError::Loss(self.updates));
            }
            sum += loss;
            self.updates += 1;
        }
        let made = (self.updates - from).max(1) as f64;
        Ok(ValuationProgress {
            updates: self.updates,
            error: (sum / made).sqrt(),
            steps: self.steps,
        })
    }

    /// The present critics.
    ///
    /// # Errors
    ///
    /// If a parameter is not finite.
    pub fn critics(&self) -> Result<[Critic; 2], ValuationError> {
        let critic = |(network, _): &(Mlp, Optimiser)| -> Result<Critic, ValuationError> {
            Ok(Critic::new(network.to_dense()?)?)
        };
        Ok([critic(&self.critics[0])?, critic(&self.critics[1])?])
    }

    /// Simulates one window of a block of aircraft: random actions, each held for some steps, then the actor's
    /// actions.
    fn fly(&mut self, block: usize) -> Result<(), ValuationError> {
        let mut rng = stream::stream(self.recipe.seed, &[FLY, self.flown, block as u64]);
        let count = WIDTH.min(self.world.instances() - block * WIDTH);
        let burst = rng.random_range(0..=self.recipe.burst);
        let mut action = random(&mut rng);
        for _ in 0..burst {
            if rng.random_range(0.0..1.0) < 0.3 {
                action = random(&mut rng);
            }
            self.world.step(block, &action)?;
        }
        let mut way = Vec::with_capacity(self.recipe.window);
        for step in 0..self.recipe.window {
            let observed = self.world.observe(block);
            // the first action of the window is random, the others are the actor's
            if step > 0 {
                action = self.actor.act_block(&mut self.units, &observed);
            }
            let stepped = self.world.step(block, &action)?;
            way.push((inputs(&observed, &action), stepped));
        }
        self.steps += (burst + self.recipe.window as u64) * count as u64;
        let last = way[way.len() - 1].1.observed;
        let beyond = inputs(&last, &self.actor.act_block(&mut self.units, &last));
        for lane in 0..count {
            self.remember(lane, &way, &beyond);
        }
        Ok(())
    }

    /// Stores the returns along the path of the aircraft in `lane`, from its end to its start. A return ends with its
    /// episode.
    fn remember(
        &mut self,
        lane: usize,
        way: &[([Block; INPUTS], Stepped)],
        beyond: &[Block; INPUTS],
    ) {
        let task = Task::PAPER;
        let discount = self.recipe.discount as f32;
        let worst = -(task.roll_cap + task.pitch_cap + task.airspeed_cap) as f32;
        let of = |numbers: &[Block; INPUTS]| numbers.map(|x| x.0[lane]);
        let (mut earned, mut weight, mut end) = (0.0, 1.0, of(beyond));
        // the value at the time limit of an episode is unknown: the steps before it are not stored
        let mut known = true;
        for (at, stepped) in way.iter().rev() {
            match stepped.ended[lane] {
                Ended::No => {
                    (earned, weight) =
                        (stepped.reward.0[lane] + discount * earned, discount * weight)
                }
                Ended::Time => known = false,
                // a lost aircraft gets the smallest reward in all further steps
                Ended::Lost => {
                    (earned, weight, known) = (worst / (1.0 - discount), 0.0, true);
                    end = of(at);
                }
            }
            if !known {
                continue;
            }
            let mut row = [0.0; ROW];
            row[..INPUTS].copy_from_slice(&of(at));
            row[INPUTS..INPUTS + 2].copy_from_slice(&[earned, weight]);
            row[INPUTS + 2..].copy_from_slice(&end);
            if row.iter().all(|x| x.is_finite()) {
                self.keep(row);
            }
        }
    }

    fn keep(&mut self, row: [f32; ROW]) {
        if self.rows.len() < self.recipe.remembered {
            self.rows.push(row);
        } else {
            self.rows[self.next] = row;
        }
        self.next = (self.next + 1) % self.recipe.remembered;
    }

    /// Makes one update of both critics. Returns the mean square of their relative errors.
    fn update(&mut self) -> Result<f64, ValuationError> {
        let mut rng = stream::stream(self.recipe.seed, &[UPDATE, self.updates]);
        let batch = self.recipe.batch;
        let mut inputs = Vec::with_capacity(batch * INPUTS);
        let mut ends = Vec::with_capacity(batch * INPUTS);
        let mut earned = Vec::with_capacity(2 * batch);
        for _ in 0..batch {
            let row = &self.rows[rng.random_range(0..self.rows.len())];
            inputs.extend(&row[..INPUTS]);
            earned.push([row[INPUTS], row[INPUTS + 1]]);
            ends.extend(&row[INPUTS + 2..]);
        }
        let part = self.updates as f64 / self.recipe.updates.max(1) as f64;
        let fall = 0.5 * (1.0 + (std::f64::consts::PI * part).cos());
        let mut sum = 0.0;
        for (critic, optimiser) in &mut self.critics {
            let at_end = critic.forward(rows(&ends, INPUTS, &self.device)).into_data();
            let at_end: Vec<f32> = at_end.try_into_vec().unwrap_or_default();
            let wanted: Vec<f32> = earned
                .iter()
                .zip(&at_end)
                .map(|([earned, weight], end)| earned + weight * end.min(0.0))
                .collect();
            let weights: Vec<f32> = wanted.iter().map(|y| 1.0 / (SMALL + y.abs())).collect();
            let followed = critic.followed();
            let values = followed.forward(rows(&inputs, INPUTS, &self.device).autodiff());
            let wanted = rows(&wanted, 1, &self.device).autodiff();
            let weights = rows(&weights, 1, &self.device).autodiff();
            let error = (values - wanted) * weights;
            let loss = (error.clone() * error).mean();
            let mut gradients = loss.backward();
            sum += f64::from(loss.into_scalar::<f32>()) / 2.0;
            optimiser.set_rate(self.recipe.rate * (0.01 + 0.99 * fall));
            optimiser.step(critic, followed, &mut gradients);
        }
        Ok(sum)
    }
}

fn rows(numbers: &[f32], width: usize, device: &Device) -> Tensor<2> {
    let data = TensorData::new(numbers.to_vec(), [numbers.len() / width, width]);
    Tensor::from_data(data, device)
}

fn inputs(observed: &[Block; OBSERVATIONS], action: &[Block; ACTIONS]) -> [Block; INPUTS] {
    let mut all = [Block::zero(); INPUTS];
    all[..OBSERVATIONS].copy_from_slice(observed);
    all[OBSERVATIONS..].copy_from_slice(action);
    all
}

/// Random actions between −1 and 1.
fn random(rng: &mut Stream) -> [Block; ACTIONS] {
    let mut action = [Block::zero(); ACTIONS];
    action.iter_mut().flat_map(|a| &mut a.0).for_each(|a| *a = rng.random_range(-1.0..1.0));
    action
}
