//! The analytic policy gradient: an actor climbs the slope of the reward, the same one every time.

use std::path::Path;

use greylag::learn::{AnalyticRecipe, AnalyticTrainer};
use greylag::model::GreyBox;

fn trainer(seed: u64) -> AnalyticTrainer {
    trainer_in("jsbsim", 0, seed)
}

/// In a model of the X8, or in `draws` from its widths.
fn trainer_in(model: &str, draws: u64, seed: u64) -> AnalyticTrainer {
    let file = format!("params/x8/{model}.toml");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let recipe = AnalyticRecipe {
        actor: vec![16, 16],
        instances: 16,
        window: 60,
        episode: 240,
        updates: 60,
        rate: 3e-3,
        draws,
        seed,
        ..AnalyticRecipe::default()
    };
    AnalyticTrainer::new(recipe, GreyBox::load(&path).unwrap()).unwrap()
}

#[test]
fn the_reward_climbs() {
    // the second steps by RK4, as models that were learned from logs do
    for (model, draws, most) in [("jsbsim", 0, 0.7), ("prior", 0, 0.7), ("prior", 16, 0.75)] {
        let mut trainer = trainer_in(model, draws, 1);
        let rewards: Vec<f64> = (0..60).map(|_| trainer.update().unwrap().reward).collect();
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        // one part of the episode's four has a start in it, so ten updates see the same mixture
        let (first, last) = (mean(&rewards[..8]), mean(&rewards[52..]));
        println!("{model}, {draws} draws: reward of a step {first:.3}, after 60 updates {last:.3}");
        // at a slope of zero it would stay where it was; the best policies earn −0.06
        assert!(last > most * first, "{model}, {draws} draws: {first} {last}");
    }
}

#[test]
fn the_same_seed_gives_the_same_actor_to_the_bit() {
    let run = |seed| {
        let mut trainer = trainer(seed);
        for _ in 0..3 {
            trainer.update().unwrap();
        }
        trainer.actor().unwrap()
    };
    assert!(run(1) == run(1));
    assert!(run(1) != run(2));
}
