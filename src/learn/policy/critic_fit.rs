//! What an actor is worth: twin critics learned from the returns of its own flights in the model.
//!
//! Critics for a search, which asks what a state is worth that the actor alone would never reach. So every
//! flight here begins off the actor's path, with random actions for some steps; then the actor flies on,
//! and each state on its way back is worth what was earned from there, with the critic's own value of the
//! last: TD(1) over a window, eq. (11) of \[GSFM26\] for the actor held. The loss is relative to the
//! return: next to the target, where returns are small, so are the differences that a search lives on.

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

/// Purposes of the random streams.
const START: u64 = 40;
const FLY: u64 = 41;
const UPDATE: u64 = 42;

/// Inputs of a critic.
const INPUTS: usize = OBSERVATIONS + ACTIONS;
/// Numbers remembered of a step: a critic's inputs, what was earned over the rest of the window, and
/// the discount of what follows it, with the inputs there.
const ROW: usize = INPUTS + 2 + INPUTS;

/// Return (of the reward of eq. 30) below which errors count absolutely.
const SMALL: f32 = 0.1;

/// What critics are learned by.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValuationRecipe {
    /// Units of a critic's hidden layers.
    pub critic: Vec<usize>,
    /// Updates in all.
    pub updates: u64,
    /// Rows of a minibatch.
    pub batch: usize,
    /// Learning rate at the start; it falls with a cosine to a hundredth.
    pub rate: f64,
    /// Aircraft at once.
    pub instances: usize,
    /// Most steps of random actions before the actor flies on.
    pub burst: u64,
    /// Steps that it flies on.
    pub window: usize,
    /// Windows before all episodes begin anew with other targets.
    pub windows: u64,
    /// Updates between two windows.
    pub between: u64,
    /// Steps remembered.
    pub remembered: usize,
    /// Discount γ per step.
    pub discount: f64,
    /// Seed of everything random.
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

/// Why critics cannot be learned.
#[derive(Debug, thiserror::Error)]
pub enum ValuationError {
    /// A loss is no number.
    #[error("the loss of the critics is no longer a number after {0} updates; lower --rate")]
    Loss(u64),
    /// A network cannot be used.
    #[error("the critics: {0}")]
    Network(#[from] DenseError),
    /// A network has another shape than a critic's.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The world cannot go on.
    #[error("the world that the actor is valued in: {0}")]
    World(#[from] Trouble),
}

/// How it went since it was last asked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ValuationProgress {
    /// Updates made.
    pub updates: u64,
    /// Root of the mean square of the critics' relative errors.
    pub error: f64,
    /// Steps flown.
    pub steps: u64,
}

/// A valuation under way.
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
    /// A valuation of `actor` in `world`, whose instances are the recipe's.
    ///
    /// # Errors
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

    /// Makes `updates` updates more, up to the recipe's.
    ///
    /// # Errors
    /// If a loss is no number or the world fails.
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

    /// The critics as they are now.
    ///
    /// # Errors
    /// If a parameter is no longer finite.
    pub fn critics(&self) -> Result<[Critic; 2], ValuationError> {
        let critic = |(network, _): &(Mlp, Optimiser)| -> Result<Critic, ValuationError> {
            Ok(Critic::new(network.to_dense()?)?)
        };
        Ok([critic(&self.critics[0])?, critic(&self.critics[1])?])
    }

    /// Random actions, each held for some steps, then the actor's: one window of a block.
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
            // the first action of the window is anyone's, the others are the actor's
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

    /// Returns along a lane's way, from the end to the start; each end of an episode on it is one.
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
        // what follows an episode that is out of time is not known: nothing before is remembered
        let mut known = true;
        for (at, stepped) in way.iter().rev() {
            match stepped.ended[lane] {
                Ended::No => {
                    (earned, weight) =
                        (stepped.reward.0[lane] + discount * earned, discount * weight)
                }
                Ended::Time => known = false,
                // a lost aircraft earns the worst for ever
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

    /// One update of both critics; gives the mean square of their relative errors.
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

/// Actions from −1 to 1.
fn random(rng: &mut Stream) -> [Block; ACTIONS] {
    let mut action = [Block::zero(); ACTIONS];
    action.iter_mut().flat_map(|a| &mut a.0).for_each(|a| *a = rng.random_range(-1.0..1.0));
    action
}
