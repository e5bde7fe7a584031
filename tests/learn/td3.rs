//! TD3: inference is burn's, a small task is learned, a training that is resumed is the same to the bit.

use std::path::Path;
use std::sync::Arc;

use burn::tensor::{Device, Tensor, TensorData};
use greylag::control::policy::{ACTIONS, Actor, Critic, OBSERVATIONS};
use greylag::learn::{Hyperparameters, Mlp, PolicyRecipe, PolicyStanding, PolicyTrainer};
use greylag::model::GreyBox;
use greylag::num::dense::Units;
use greylag::num::{Dense, Real, stream};
use greylag::sim::Trouble;
use greylag::sim::imagined::{Block, Ended, Imagination, Stepped, WIDTH};
use greylag::sim::targets::Stratified;
use greylag::sim::world::World;

#[test]
fn every_way_to_ask_a_network_gives_burns_answer() {
    let settings = Hyperparameters::default();
    let mut rng = stream::stream(4, &[]);
    let actor = Actor::new(Dense::uniform(&settings.actor_sizes(), &mut rng).unwrap()).unwrap();
    let critic = Critic::new(Dense::uniform(&settings.critic_sizes(), &mut rng).unwrap()).unwrap();
    let device = Device::flex();
    let ask = |network: &Dense, input: &[f32]| -> Vec<f32> {
        let rows: Tensor<2> =
            Tensor::from_data(TensorData::new(input.to_vec(), [1, input.len()]), &device);
        Mlp::new(network, &device).forward(rows).into_data().try_into_vec().unwrap()
    };
    for k in 0..50 {
        let observed: [f32; OBSERVATIONS] =
            std::array::from_fn(|i| 2.0 * ((7 * k + i) as f32 * 0.9).sin());
        let burns: Vec<f32> = ask(actor.network(), &observed).into_iter().map(f32::tanh).collect();
        let one = actor.act_one(&mut Units::new(0.0), &observed);
        let lanes = observed.map(|x| Block::from_f64(x.into()));
        let block = actor.act_block(&mut Units::new(Block::zero()), &lanes);
        let action = block.map(|a| a.0[9]);
        let input = [&observed[..], &action].concat();
        let value = critic.value(&mut Units::new(Block::zero()), &lanes, &block).0[2];
        for i in 0..ACTIONS {
            // rounding of sums of 300 terms in single precision
            assert!((one[i] - burns[i]).abs() < 1e-5 && (action[i] - burns[i]).abs() < 1e-5);
        }
        assert!((value - ask(critic.network(), &input)[0]).abs() < 1e-5);
    }
}

/// Aircraft that are told a number and earn most by answering it: every step is one of its own.
struct Echo {
    told: Block,
    given: u64,
}

impl Echo {
    fn tell(&mut self) {
        use rand::RngExt;
        let mut rng = stream::stream(9, &[self.given]);
        self.told.0.iter_mut().for_each(|x| *x = rng.random_range(-0.8..0.8));
        self.given += 1;
    }
}

impl World for Echo {
    fn instances(&self) -> usize {
        WIDTH
    }
    fn observe(&self, _: usize) -> [Block; OBSERVATIONS] {
        let mut observed = [Block::zero(); OBSERVATIONS];
        observed[13] = self.told;
        observed
    }
    fn step(&mut self, _: usize, action: &[Block; ACTIONS]) -> Result<Stepped, Trouble> {
        let reward = -(action[0] - self.told).abs();
        self.tell();
        Ok(Stepped { observed: self.observe(0), reward, ended: [Ended::No; WIDTH] })
    }
    fn restart(&mut self, targets: u64) -> Result<(), Trouble> {
        self.given = targets;
        self.tell();
        Ok(())
    }
    fn targets(&self) -> u64 {
        self.given
    }
    fn lost(&self) -> u64 {
        0
    }
}

#[test]
fn a_small_task_is_learned() {
    let recipe = PolicyRecipe {
        td3: Hyperparameters {
            actor: vec![32, 32],
            critic: vec![32, 32],
            discount: 0.5,
            actor_rate: 1e-3,
            critic_rate: 1e-3,
            batch: 64,
            ..Hyperparameters::default()
        },
        steps: 6_000,
        warmup: 1_000,
        replay: 6_000,
        ..PolicyRecipe::default()
    };
    let mut world = Echo { told: Block::zero(), given: 0 };
    world.tell();
    let mut trainer = PolicyTrainer::new(recipe, world, "echo".into()).unwrap();
    let error = |actor: &Actor| -> f32 {
        let mut units = Units::new(0.0);
        let of = |told: f32, units: &mut Units<f32>| {
            let mut observed = [0.0; OBSERVATIONS];
            observed[13] = told;
            (actor.act_one(units, &observed)[0] - told).abs()
        };
        (-8..=8).map(|k| of(0.1 * k as f32, &mut units)).sum::<f32>() / 17.0
    };
    let before = error(&trainer.actor());
    let progress = trainer.run(6_000).unwrap();
    let after = error(&trainer.actor());
    println!("mean error {before:.3} before, {after:.3} after; {progress:?}");
    // answering nothing is off by 0.42 on average; the noise that explores alone is 0.1
    assert!(before > 0.3 && after < 0.1);
}

fn training(seed: u64) -> PolicyTrainer<Imagination> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    let model = Arc::new(GreyBox::load(&path).unwrap());
    let recipe = PolicyRecipe {
        td3: Hyperparameters {
            actor: vec![16, 16],
            critic: vec![16],
            batch: 32,
            ..Hyperparameters::default()
        },
        steps: 1_600,
        warmup: 320,
        // fewer than the steps, so that the memory has gone round
        replay: 1_000,
        instances: 20,
        checkpoint: 600,
        seed,
        ..PolicyRecipe::default()
    };
    let world = Imagination::new(model, 20, Stratified::new(seed, 0, 0.2));
    PolicyTrainer::new(recipe, world, format!("seed {seed}")).unwrap()
}

/// An interval of evaluations that is as good as none must not overflow.
#[test]
fn a_run_of_any_length_stops_at_each_checkpoint() {
    let mut trainer = training(3);
    trainer.run(u64::MAX).unwrap();
    assert_eq!(trainer.steps(), 600);
    trainer.run(u64::MAX).unwrap();
    assert_eq!(trainer.steps(), 1_200);
}

#[test]
fn a_training_that_is_resumed_ends_as_one_that_was_not_interrupted() {
    let end = |trainer: &mut PolicyTrainer<Imagination>| {
        while trainer.steps() < 1_600 {
            trainer.run(130).unwrap();
        }
        (trainer.standing().td3, trainer.actor())
    };
    let straight = end(&mut training(3));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let mut first = training(3);
    while !first.at_checkpoint() {
        first.run(130).unwrap();
    }
    first.standing().save(&path).unwrap();
    assert_eq!(first.steps(), 600);
    // goes on, and is lost between two checkpoints
    first.run(130).unwrap();
    drop(first);
    let mut again = training(3);
    again.resume(PolicyStanding::load(&path).unwrap()).unwrap();
    assert!(end(&mut again) == straight, "the resumed training ended elsewhere");
    assert!(end(&mut training(4)) != straight, "another seed ended in the same place");
    let other = training(4).resume(PolicyStanding::load(&path).unwrap());
    assert!(other.unwrap_err().to_string().contains("another training"));
}
