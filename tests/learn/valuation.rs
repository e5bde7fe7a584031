//! Critics of an actor held: what they say of a state is what the actor earns from there.

use std::path::Path;
use std::sync::Arc;

use greylag::control::policy::{ACTIONS, Actor, Agent, Critic};
use greylag::control::task::Task;
use greylag::learn::{Valuation, ValuationRecipe};
use greylag::model::GreyBox;
use greylag::num::dense::Units;
use greylag::num::{Real, stream};
use greylag::sim::imagined::{Block, Ended, Imagination, WIDTH};
use greylag::sim::targets::Stratified;
use rand::RngExt;

fn recipe() -> ValuationRecipe {
    ValuationRecipe { critic: vec![48, 48], updates: 1500, batch: 256, ..Default::default() }
}

fn ground() -> (Arc<GreyBox>, Agent) {
    let params = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    let model = GreyBox::load(&params.join("jsbsim.toml")).unwrap();
    let agent = Agent::load(&params.join("policy"), &model.airframe).unwrap();
    (Arc::new(model), agent)
}

fn world(model: &Arc<GreyBox>, seed: u64, instances: usize) -> Imagination {
    Imagination::new(model.clone(), instances, Stratified::new(seed, 0, 0.3))
}

/// What a critic says of aircraft pushed off the actor's path, and what they earn from there: the
/// correlation of the two over 64 aircraft, and their means.
fn compare(model: &Arc<GreyBox>, actor: &Actor, critic: &Critic) -> (f64, [f64; 2]) {
    // targets that no training had; a random action held for eight steps
    let mut unseen = world(model, 77, 4 * WIDTH);
    let mut units = Units::new(Block::zero());
    let mut rng = stream::stream(9, &[]);
    let mut pairs = Vec::new();
    for block in 0..unseen.blocks() {
        let mut push = [Block::zero(); ACTIONS];
        push.iter_mut().flat_map(|a| &mut a.0).for_each(|a| *a = rng.random_range(-1.0..1.0));
        for _ in 0..8 {
            unseen.step(block, &push);
        }
        let start = unseen.observe(block);
        let action = actor.act_block(&mut units, &start);
        let said = critic.value(&mut units, &start, &action);
        let (mut earned, mut weight) = (Block::zero(), 1.0);
        for _ in 0..600 {
            let action = actor.act_block(&mut units, &unseen.observe(block));
            let stepped = unseen.step(block, &action);
            assert!(!stepped.ended.contains(&Ended::Lost));
            earned += stepped.reward.scale(weight);
            weight *= Task::PAPER.discount;
        }
        pairs.extend(said.0.into_iter().zip(earned.0).map(|(a, b)| [f64::from(a), f64::from(b)]));
    }
    let mean = |f: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(f).sum::<f64>() / pairs.len() as f64;
    let means = [mean(&|p| p[0]), mean(&|p| p[1])];
    let product = |i: usize, j: usize| mean(&|p| (p[i] - means[i]) * (p[j] - means[j]));
    (product(0, 1) / (product(0, 0) * product(1, 1)).sqrt(), means)
}

#[test]
fn the_shipped_critics_say_what_is_flown() {
    let (model, agent) = ground();
    for critic in agent.critics.iter().flat_map(|both| both.iter()) {
        let (correlation, [said, earned]) = compare(&model, &agent.actor, critic);
        println!("correlation {correlation:.4}, said {said:.2}, earned {earned:.2}");
        assert!(correlation > 0.98, "{correlation}");
        assert!((said / earned - 1.0).abs() < 0.1, "{said} {earned}");
    }
}

/// A tenth of the usual training with half the units: the order is there, the height not yet.
#[test]
fn values_become_the_returns_flown() {
    let (model, agent) = ground();
    let world = world(&model, 1, 64);
    let mut valuation = Valuation::new(recipe(), world, agent.actor.as_ref().clone()).unwrap();
    let first = valuation.run(100).unwrap();
    let last = valuation.run(u64::MAX).unwrap();
    assert!(last.error < 0.5 * first.error, "{first:?} {last:?}");
    let (correlation, [said, earned]) =
        compare(&model, &agent.actor, &valuation.critics().unwrap()[0]);
    assert!(correlation > 0.9, "{correlation}");
    assert!((said / earned - 1.0).abs() < 0.4, "{said} {earned}");
}

/// The same seed gives the same critics to the bit.
#[test]
fn a_valuation_repeats() {
    let (model, agent) = ground();
    let run = || {
        let recipe = ValuationRecipe { updates: 30, batch: 32, ..recipe() };
        let world = world(&model, 1, 32);
        let mut valuation = Valuation::new(recipe, world, agent.actor.as_ref().clone()).unwrap();
        valuation.run(u64::MAX).unwrap();
        valuation.critics().unwrap()
    };
    assert_eq!(run(), run());
}
