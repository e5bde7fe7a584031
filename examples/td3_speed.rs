//! How fast imagination and TD3 are on one core: `cargo run --release --ignore-rust-version
//! --no-default-features --features learn --example td3_speed [-- MODEL.toml]`.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use greylag::control::policy::{Actor, Policy};
use greylag::control::{Controller, Observation, Target};
use greylag::learn::{Batch, Hyperparameters, Replay, Td3, Transition};
use greylag::model::GreyBox;
use greylag::num::dense::Units;
use greylag::num::{Dense, Real, stream};
use greylag::physics::{ActuatorState, Command, State, Time};
use greylag::sim::imagined::{Block, Imagination};
use greylag::sim::targets::Stratified;

fn main() -> Result<()> {
    let shipped = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    let model = GreyBox::load(&std::env::args().nth(1).map_or(shipped, PathBuf::from))?;
    imagine(model);
    act()?;
    learn()
}

/// Steps of 64 aircraft with and without the actor.
fn imagine(model: GreyBox) {
    let mut world = Imagination::new(Arc::new(model), 64, Stratified::new(1, 0, 0.0));
    let action = [Block::zero(); 3];
    let start = Instant::now();
    let rounds = 20_000;
    for _ in 0..rounds {
        for block in 0..world.blocks() {
            world.step(block, &action);
        }
    }
    let rate = f64::from(rounds * 64) / start.elapsed().as_secs_f64();
    let [episodes, lost] = world.episodes();
    println!(
        "imagined steps:   {:.2} million a second ({episodes} episodes, {lost} lost)",
        rate / 1e6
    );
}

/// The time of one decision in flight.
fn act() -> Result<()> {
    let settings = Hyperparameters::default();
    let network = Dense::uniform(&settings.actor_sizes(), &mut stream::stream(1, &[]))?;
    let actor = Arc::new(Actor::new(network)?);
    let mut policy = Policy::of(actor.clone());
    let mut seen = Observation {
        time: Time::default(),
        state: State::NEUTRAL,
        actuators: ActuatorState::default(),
        altitude: 600.0,
        previous: [Command::IDLE; 2],
    };
    let target = Target { roll: 0.5, pitch: 0.1, airspeed: 16.67 };
    let start = Instant::now();
    for _ in 0..20_000 {
        seen.state.roll = 0.1 * policy.command(&seen, &target).aileron;
    }
    println!("policy in flight: {:.2} us a step", 1e6 * start.elapsed().as_secs_f64() / 2e4);
    let (mut units, mut x) = (Units::new(Block::zero()), [Block::from_f64(0.1); 15]);
    let start = Instant::now();
    for _ in 0..2_000 {
        x[0] = actor.act_block(&mut units, &x)[0];
    }
    println!("actor in lanes:   {:.2} us for 16", 1e6 * start.elapsed().as_secs_f64() / 2e3);
    Ok(())
}

/// Updates of Table VII.
fn learn() -> Result<()> {
    let mut td3 = Td3::new(Hyperparameters::default(), &mut stream::stream(1, &[]))?;
    let mut replay = Replay::new(10_000);
    for k in 0..10_000 {
        let x = |i: usize| ((k * 31 + i) as f32 * 0.37).sin();
        replay.add(&Transition {
            observed: std::array::from_fn(x),
            action: std::array::from_fn(|i| x(i + 40)),
            reward: -x(50).abs(),
            next: std::array::from_fn(|i| x(i + 1)),
            goes_on: 1.0,
        });
    }
    let mut rng = stream::stream(2, &[]);
    let mut batch = Batch::default();
    let count = 300;
    let start = Instant::now();
    for _ in 0..count {
        replay.draw(&mut rng, 256, &mut batch);
        td3.update(&batch, &mut rng);
    }
    let seconds = start.elapsed().as_secs_f64();
    println!("TD3 updates:      {:.0} a second", f64::from(count) / seconds);
    Ok(())
}
