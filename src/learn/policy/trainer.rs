//! Training of a policy with the algorithm TD3 (twin delayed policy gradient) in any environment. The number of updates is
//! the number of environment steps after the warm-up.

use std::sync::Arc;

use rand::RngExt as _;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::policy::replay::{Batch, Replay, Transition};
use crate::policy::td3::{Hyperparameters, Standing, Td3};
use greylag_control::policy::{ACTIONS, Actor, Critic, OBSERVATIONS, ShapeError};
use greylag_control::task::Task;
use greylag_num::dense::{DenseError, Units};
use greylag_num::stream::{self, Stream};
use greylag_num::{Real, statistics};
use greylag_sim::Trouble;
use greylag_sim::imagined::{Block, Ended, Stepped, WIDTH};
use greylag_sim::world::World;

/// Ids of the random streams for initial weights, exploration and updates.
const START: u64 = 20;
const ACT: u64 = 21;
const UPDATE: u64 = 22;

/// Settings of a policy training. [`PolicyRecipe::default`] has those of \[GSFM26\] (T. Guerin et al., 2026, see
/// `src/lib.rs`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolicyRecipe {
    /// Hyperparameters of the algorithm TD3.
    pub td3: Hyperparameters,
    /// Total number of environment steps, summed over the simulated aircraft.
    pub steps: u64,
    /// Number of warm-up steps with random actions and without updates.
    pub warmup: u64,
    /// Capacity of the replay buffer, transitions.
    pub replay: usize,
    /// Number of simulated aircraft.
    pub instances: usize,
    /// Fraction (0..1) of the target attitudes that are drawn in the corners of the target range: |roll| of 45° to 60° with
    /// |pitch| of 25° to 30°.
    pub corners: f64,
    /// Number of environment steps between checkpoints. All episodes restart at a checkpoint. A resumed training therefore
    /// equals an uninterrupted one.
    pub checkpoint: u64,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for PolicyRecipe {
    fn default() -> Self {
        PolicyRecipe {
            td3: Hyperparameters::default(),
            steps: 700_000,
            warmup: 10_000,
            replay: 1_000_000,
            instances: 64,
            corners: 0.0,
            checkpoint: 50_000,
            seed: 1,
        }
    }
}

/// A training cannot continue.
#[derive(Debug, thiserror::Error)]
pub enum PolicyError {
    /// The loss of the critics is not finite.
    #[error("the loss of the critics is not finite after {0} steps; lower the learning rates")]
    Loss(u64),
    /// A network cannot be used.
    #[error("the networks: {0}")]
    Network(#[from] DenseError),
    /// A network does not have a policy's shape.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The environment cannot continue.
    #[error("the training environment: {0}")]
    World(#[from] Trouble),
    /// A checkpoint belongs to another training.
    #[error(
        "the checkpoint is of another training (other options, model or program); name another --out"
    )]
    Other,
}

/// State of a training.
pub struct PolicyTrainer<W: World> {
    recipe: PolicyRecipe,
    identity: String,
    world: W,
    td3: Td3,
    actor: Actor,
    replay: Replay,
    batch: Batch,
    units: Units<Block>,
    steps: u64,
    losses: Vec<f64>,
    rewards: Vec<f64>,
}

/// Progress of a training. Loss and reward are means since the last call of [`PolicyTrainer::run`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PolicyProgress {
    /// Number of steps made.
    pub steps: u64,
    /// Number of updates made.
    pub updates: u64,
    /// Mean loss of the critics; NaN before the first update.
    pub loss: f64,
    /// Mean reward per step. A step in which an aircraft is lost counts here with the smallest reward of a single
    /// step, `Task::worst` (−1.1). For the critics, the reward of this step is the discounted sum of `Task::worst` over all
    /// further steps, `Task::of_loss` (−110).
    pub reward: f64,
    /// Number of episodes started.
    pub episodes: u64,
    /// Number of episodes that ended because a validity limit of the environment was exceeded.
    pub lost: u64,
}

/// State of a training for a checkpoint.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyStanding {
    /// Identity of recipe and environment.
    pub identity: String,
    /// Number of steps made.
    pub steps: u64,
    /// Number of target attitudes drawn.
    pub targets: u64,
    /// Number of transitions ever added to the replay buffer.
    pub remembered: u64,
    /// Contents of the replay buffer.
    pub replay: Vec<f32>,
    /// State of the networks.
    pub td3: Standing,
}

impl<W: World> PolicyTrainer<W> {
    /// A training in the environment `world`, whose number of aircraft must be that of the recipe. `identity` distinguishes
    /// the training from others.
    ///
    /// # Errors
    ///
    /// If the networks cannot be built.
    pub fn new(recipe: PolicyRecipe, world: W, identity: String) -> Result<Self, PolicyError> {
        let td3 = Td3::new(recipe.td3.clone(), &mut stream::stream(recipe.seed, &[START]))?;
        let actor = Actor::new(td3.actor()?)?;
        Ok(PolicyTrainer {
            replay: Replay::new(recipe.replay),
            recipe,
            identity,
            world,
            td3,
            actor,
            batch: Batch::default(),
            units: Units::new(Block::zero()),
            steps: 0,
            losses: Vec::new(),
            rewards: Vec::new(),
        })
    }

    /// Trains for about `steps` further steps. Stops earlier at a checkpoint or at the recipe's total number of steps.
    ///
    /// # Errors
    ///
    /// If a loss is not finite or the environment fails.
    pub fn run(&mut self, steps: u64) -> Result<PolicyProgress, PolicyError> {
        let until = self.steps.saturating_add(steps);
        let until = until.min(self.recipe.steps).min(self.next_checkpoint());
        while self.steps < until {
            self.advance()?;
        }
        if self.at_checkpoint() {
            let given = self.world.targets();
            self.world.restart(given)?;
        }
        let mean = |list: &mut Vec<f64>| statistics::mean(&std::mem::take(list));
        Ok(PolicyProgress {
            steps: self.steps,
            updates: self.td3.updates(),
            loss: mean(&mut self.losses),
            reward: mean(&mut self.rewards),
            episodes: self.world.targets(),
            lost: self.world.lost(),
        })
    }

    fn next_checkpoint(&self) -> u64 {
        (self.steps / self.recipe.checkpoint + 1) * self.recipe.checkpoint
    }

    /// Whether the last step of all aircraft reached or crossed the step number of a checkpoint.
    pub fn at_checkpoint(&self) -> bool {
        let stretch = |steps: u64| steps / self.recipe.checkpoint;
        let before = self.steps.saturating_sub(self.world.instances() as u64);
        stretch(before) != stretch(self.steps)
    }

    /// Makes one step of every aircraft. After the warm-up, makes as many updates as there are aircraft.
    fn advance(&mut self) -> Result<(), PolicyError> {
        let mut rng = stream::stream(self.recipe.seed, &[ACT, self.steps]);
        let instances = self.world.instances();
        for block in 0..instances.div_ceil(WIDTH) {
            let observed = self.world.observe(block);
            let action = self.explore(&observed, &mut rng);
            let stepped = self.world.step(block, &action)?;
            for lane in 0..WIDTH.min(instances - block * WIDTH) {
                self.remember(lane, &observed, &action, &stepped);
            }
        }
        self.steps += instances as u64;
        if self.steps <= self.recipe.warmup {
            return Ok(());
        }
        for _ in 0..instances {
            let mut rng = stream::stream(self.recipe.seed, &[UPDATE, self.td3.updates()]);
            self.replay.draw(&mut rng, self.recipe.td3.batch, &mut self.batch);
            let losses = self.td3.update(&self.batch, &mut rng);
            if !losses.critics.is_finite() {
                return Err(PolicyError::Loss(self.steps));
            }
            self.losses.push(losses.critics.into());
        }
        self.actor = Actor::new(self.td3.actor()?)?;
        Ok(())
    }

    /// Actions for a block of aircraft: random ones in the warm-up, then the actor's actions with exploration noise.
    fn explore(&mut self, observed: &[Block; OBSERVATIONS], rng: &mut Stream) -> [Block; ACTIONS] {
        if self.steps < self.recipe.warmup {
            let mut action = [Block::zero(); ACTIONS];
            action.iter_mut().flat_map(|a| &mut a.0).for_each(|a| *a = rng.random_range(-1.0..1.0));
            return action;
        }
        let mut action = self.actor.act_block(&mut self.units, observed);
        for a in action.iter_mut().flat_map(|a| &mut a.0) {
            let noise: f32 = StandardNormal.sample(rng);
            *a = (*a + self.recipe.td3.exploration as f32 * noise).clamp(-1.0, 1.0);
        }
        action
    }

    fn remember(
        &mut self,
        lane: usize,
        observed: &[Block; OBSERVATIONS],
        action: &[Block; ACTIONS],
        stepped: &Stepped,
    ) {
        let lost = stepped.ended[lane] == Ended::Lost;
        let of = |numbers: &[Block; OBSERVATIONS]| numbers.map(|x| x.0[lane]);
        let task = Task { discount: self.recipe.td3.discount, ..Task::PAPER };
        // the state after the loss of an aircraft may not be finite and is not stored
        let reward = match lost {
            true => task.of_loss() as f32,
            false => stepped.reward.0[lane],
        };
        self.rewards.push(if lost { task.worst() } else { reward.into() });
        let observed = of(observed);
        self.replay.add(&Transition {
            observed,
            action: action.map(|x| x.0[lane]),
            reward,
            next: if lost { observed } else { of(&stepped.observed) },
            goes_on: if lost { 0.0 } else { 1.0 },
        });
    }

    /// Number of steps made.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Settings of the training.
    pub fn recipe(&self) -> &PolicyRecipe {
        &self.recipe
    }

    /// The actor in its present state.
    pub fn actor(&self) -> Arc<Actor> {
        Arc::new(self.actor.clone())
    }

    /// The critics in their present state.
    ///
    /// # Errors
    ///
    /// If a parameter is not finite.
    pub fn critics(&self) -> Result<Arc<[Critic; 2]>, PolicyError> {
        let [one, two] = self.td3.critics()?;
        Ok(Arc::new([Critic::new(one)?, Critic::new(two)?]))
    }

    /// State for a checkpoint. The state is valid only while `at_checkpoint` is true.
    pub fn standing(&self) -> PolicyStanding {
        PolicyStanding {
            identity: self.identity.clone(),
            steps: self.steps,
            targets: self.world.targets(),
            remembered: self.replay.added(),
            replay: self.replay.numbers().to_vec(),
            td3: self.td3.standing(),
        }
    }

    /// Resumes from the state `standing` of a training with the same identity.
    ///
    /// # Errors
    ///
    /// If the checkpoint belongs to another training.
    pub fn resume(&mut self, standing: PolicyStanding) -> Result<(), PolicyError> {
        if standing.identity != self.identity {
            return Err(PolicyError::Other);
        }
        let PolicyStanding { replay, remembered, .. } = standing;
        let replay = Replay::restore(self.recipe.replay, replay, remembered);
        self.replay = replay.ok_or(PolicyError::Other)?;
        self.td3.resume(standing.td3)?;
        self.actor = Actor::new(self.td3.actor()?)?;
        self.steps = standing.steps;
        // before the checkpoint was written, the restart had already drawn one target for each aircraft
        let begun = self.world.instances() as u64;
        Ok(self.world.restart(standing.targets.saturating_sub(begun))?)
    }
}
