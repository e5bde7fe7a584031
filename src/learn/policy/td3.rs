//! The update of TD3 (twin delayed deep deterministic policy gradient, Fujimoto et al. 2018) with the values of Table VII of
//! \[GSFM26\] (see `src/lib.rs`). The actor is the network of the policy. The two critics estimate the return, the discounted sum
//! of rewards.
//!
//! Departures from the paper:
//! - Observations are scaled, and contain attitude errors instead of commanded attitudes
//!   ([`greylag_control::policy::observe`]). The information is the same.
//! - A state outside the model's validity limits is terminal. Its reward is that of infinitely many steps with the smallest
//!   reward, −(κ_φ + κ_θ + κ_v)/(1 − γ). The end of an episode by its time limit is not terminal: the critics' value of the next
//!   state is added. The paper specifies neither.
//! - The actor's last layer is initialised near zero. The first commands are therefore near neutral surfaces and half throttle.

use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::policy::mlp::{Mlp, Moments, Optimiser};
use crate::policy::replay::Batch;
use greylag_control::policy::{ACTIONS, OBSERVATIONS};
use greylag_num::Dense;
use greylag_num::dense::DenseError;

/// Hyperparameters of TD3. Those of Table VII are [`Hyperparameters::default`].
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Hyperparameters {
    /// Number of units of each hidden layer of the actor.
    pub actor: Vec<usize>,
    /// Number of units of each hidden layer of a critic.
    pub critic: Vec<usize>,
    /// Discount factor γ per step.
    pub discount: f64,
    /// Fraction τ of the difference by which a soft update moves the target networks.
    pub tau: f64,
    /// Learning rate of the actor.
    pub actor_rate: f64,
    /// Learning rate of the critics.
    pub critic_rate: f64,
    /// Number d of critic updates per actor update.
    pub delay: u64,
    /// Standard deviation of the target policy's smoothing noise, σ.
    pub smoothing: f64,
    /// Clipping limit of the smoothing noise, c.
    pub smoothing_clip: f64,
    /// Standard deviation of the exploration noise, in units of the action (−1..1).
    pub exploration: f64,
    /// Number of transitions in a minibatch.
    pub batch: usize,
}

impl Default for Hyperparameters {
    fn default() -> Self {
        Hyperparameters {
            actor: vec![300, 300],
            critic: vec![200, 200, 200],
            discount: 0.99,
            tau: 0.05,
            actor_rate: 3e-4,
            critic_rate: 3e-4,
            delay: 2,
            smoothing: 0.2,
            smoothing_clip: 0.5,
            exploration: 0.1,
            batch: 256,
        }
    }
}

/// Actor, two critics and their three target networks, with the optimisers.
#[derive(Clone)]
pub struct Td3 {
    settings: Hyperparameters,
    device: Device,
    actor: Learner,
    critics: [Learner; 2],
    updates: u64,
}

/// A network, its target network and its optimiser.
#[derive(Clone)]
struct Learner {
    network: Mlp,
    target: Mlp,
    optimiser: Optimiser,
}

/// Losses of one update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Losses {
    /// Sum of the mean squared errors of the two critics, eq. (2).
    pub critics: f32,
}

/// State of a [`Td3`] for a checkpoint. For the actor and each critic it has the parameters of the network, the parameters of the
/// target network and the optimiser's moments.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// Number of updates made.
    pub updates: u64,
    /// States of actor, first critic and second critic, each with network, target network and moments.
    pub networks: [(Vec<f32>, Vec<f32>, Moments); 3],
}

impl Learner {
    fn new(network: &Dense, rate: f64, device: &Device) -> Learner {
        let network = Mlp::new(network, device);
        let optimiser = Optimiser::new(&network, rate);
        Learner { target: network.clone(), network, optimiser }
    }

    fn standing(&self) -> (Vec<f32>, Vec<f32>, Moments) {
        (self.network.parameters(), self.target.parameters(), self.optimiser.moments())
    }
}

impl Td3 {
    /// Networks with random initial parameters from `rng`.
    ///
    /// # Errors
    ///
    /// If a layer cannot be evaluated.
    pub fn new(settings: Hyperparameters, rng: &mut impl Rng) -> Result<Td3, DenseError> {
        let device = Device::flex();
        let mut actor = Dense::uniform(&settings.actor_sizes(), rng)?;
        let last = settings.actor.last().map_or(0, |n| (n + 1) * ACTIONS);
        let first = actor.parameters().len() - last;
        actor.parameters_mut()[first..].iter_mut().for_each(|p| *p *= 0.1);
        let mut critic = || Dense::uniform(&settings.critic_sizes(), rng);
        let critics = [critic()?, critic()?];
        Ok(Td3 {
            actor: Learner::new(&actor, settings.actor_rate, &device),
            critics: critics.map(|c| Learner::new(&c, settings.critic_rate, &device)),
            settings,
            device,
            updates: 0,
        })
    }

    /// Makes one update with the minibatch `batch`, eqs. (1) to (3). The smoothing noise is drawn from `rng`.
    pub fn update(&mut self, batch: &Batch, rng: &mut impl Rng) -> Losses {
        let rows = |numbers: &[f32], width: usize| -> Tensor<2> {
            let data = TensorData::new(numbers.to_vec(), [batch.size, width]);
            Tensor::from_data(data, &self.device)
        };
        let observed = rows(&batch.observed, OBSERVATIONS);
        // target of the critics from the next state: eq. (1)
        let next = rows(&batch.next, OBSERVATIONS);
        let noise = rows(&self.noise(batch.size, rng), ACTIONS);
        let action = (self.actor.target.forward(next.clone()).tanh() + noise).clamp(-1.0, 1.0);
        let there = Tensor::cat(vec![next, action], 1);
        let [one, two] = &self.critics;
        let value = one.target.forward(there.clone()).min_pair(two.target.forward(there));
        let goes_on = rows(&batch.goes_on, 1) * self.settings.discount;
        let wanted = (rows(&batch.reward, 1) + goes_on * value).autodiff();
        // update of the critics: eq. (2)
        let here = Tensor::cat(vec![observed.clone(), rows(&batch.action, ACTIONS)], 1).autodiff();
        let followed = [one.network.followed(), two.network.followed()];
        let [one, two] =
            [0, 1].map(|k| (followed[k].forward(here.clone()) - wanted.clone()).square().mean());
        let loss = one + two;
        let mut gradients = loss.backward();
        for (critic, followed) in self.critics.iter_mut().zip(followed) {
            critic.optimiser.step(&mut critic.network, followed, &mut gradients);
        }
        self.updates += 1;
        // every d updates, the actor, eq. (3), and the target networks are updated too
        if self.updates.is_multiple_of(self.settings.delay) {
            self.improve(observed);
        }
        Losses { critics: loss.into_scalar::<f32>() }
    }

    fn improve(&mut self, observed: Tensor<2>) {
        let observed = observed.autodiff();
        let followed = self.actor.network.followed();
        let action = followed.forward(observed.clone()).tanh();
        let here = Tensor::cat(vec![observed, action], 1);
        let loss = -self.critics[0].network.passed().forward(here).mean();
        let mut gradients = loss.backward();
        self.actor.optimiser.step(&mut self.actor.network, followed, &mut gradients);
        self.follow();
    }

    /// Soft update of the target networks.
    fn follow(&mut self) {
        for learner in self.critics.iter_mut().chain([&mut self.actor]) {
            learner.target.approach(&learner.network, self.settings.tau);
        }
    }

    /// Clipped smoothing noise for the target policy.
    fn noise(&self, rows: usize, rng: &mut impl Rng) -> Vec<f32> {
        let (deviation, clip) =
            (self.settings.smoothing as f32, self.settings.smoothing_clip as f32);
        let draw = |_| {
            let x: f32 = StandardNormal.sample(rng);
            (deviation * x).clamp(-clip, clip)
        };
        (0..rows * ACTIONS).map(draw).collect()
    }

    /// Number of updates made.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Hyperparameters of the training.
    pub fn settings(&self) -> &Hyperparameters {
        &self.settings
    }

    /// The actor's network.
    ///
    /// # Errors
    ///
    /// If a parameter is not finite.
    pub fn actor(&self) -> Result<Dense, DenseError> {
        self.actor.network.to_dense()
    }

    /// The critics' networks.
    ///
    /// # Errors
    ///
    /// If a parameter is not finite.
    pub fn critics(&self) -> Result<[Dense; 2], DenseError> {
        let [one, two] = &self.critics;
        Ok([one.network.to_dense()?, two.network.to_dense()?])
    }

    /// The state of the training for a checkpoint.
    pub fn standing(&self) -> Standing {
        let [one, two] = &self.critics;
        let networks = [self.actor.standing(), one.standing(), two.standing()];
        Standing { updates: self.updates, networks }
    }

    /// Restores the state of a training with the same hyperparameters.
    ///
    /// # Errors
    ///
    /// If `standing` belongs to networks of other sizes.
    pub fn resume(&mut self, standing: Standing) -> Result<(), DenseError> {
        let Standing { updates, networks } = standing;
        let [actor, critic] = [self.settings.actor_sizes(), self.settings.critic_sizes()];
        let [one, two] = &mut self.critics;
        let learners = [&mut self.actor, one, two].into_iter();
        for ((learner, sizes), (own, target, moments)) in
            learners.zip([&actor, &critic, &critic]).zip(networks)
        {
            learner.network = Mlp::new(&Dense::new(sizes, own)?, &self.device);
            learner.target = Mlp::new(&Dense::new(sizes, target)?, &self.device);
            let found = moments.mean.len();
            if !learner.optimiser.remember(moments) {
                let expected = learner.network.parameters().len();
                return Err(DenseError::Count { sizes: sizes.clone(), expected, found });
            }
        }
        self.updates = updates;
        Ok(())
    }
}

impl Hyperparameters {
    /// Layer sizes of the actor.
    pub fn actor_sizes(&self) -> Vec<usize> {
        [&[OBSERVATIONS], &self.actor[..], &[ACTIONS]].concat()
    }

    /// Layer sizes of a critic.
    pub fn critic_sizes(&self) -> Vec<usize> {
        [&[OBSERVATIONS + ACTIONS], &self.critic[..], &[1]].concat()
    }
}
