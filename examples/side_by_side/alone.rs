//! Timings of TD3 updates, simulated aircraft, policies and the processor's peak performance.

use std::path::Path;
use std::sync::Arc;

use anyhow::Result;
use greylag::control::cem::{Aids, Cem, Instructions, Settings};
use greylag::control::policy::{Actor, OBSERVATIONS, Policy};
use greylag::control::{Controller, Observation, Target};
use greylag::learn::{Batch, Hyperparameters, Replay, Td3, Transition};
use greylag::model::GreyBox;
use greylag::num::dense::Units;
use greylag::num::{Dense, Real, stream};
use greylag::physics::{ActuatorState, Command, Controls, State, Time};
use greylag::sim::imagined::{Block, Imagination};
use greylag::sim::targets::Stratified;

use crate::problem::{self, Scoring};
use crate::processor::{Operations, narrow_peak, peak, steps_per_second};
use crate::{Timed, clock, median};

/// Peak performance of one core of a Raspberry Pi 5, FLOP/s: 2.4 GHz with two pipelines of four fused multiply-adds.
const PI_PEAK: f64 = 38.4e9;

/// Makes a function that times TD3 updates with the hyperparameters of Table VII.
pub fn updates() -> Result<impl FnMut(usize) -> Result<Timed>> {
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
    Ok(move |calls| {
        let start = clock::now();
        for _ in 0..calls {
            replay.draw(&mut rng, 256, &mut batch);
            td3.update(&batch, &mut rng);
        }
        // only every second update includes the actor, so the mean time is used
        let mean = (clock::now() - start) / calls as f64;
        Ok(Timed { seconds: vec![mean], value: 0.0 })
    })
}

/// Prints the timings for which there is no comparison.
pub fn print(scorings: &[Scoring]) -> Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    imagine(GreyBox::load(&folder.join("jsbsim.toml"))?);
    for width in [128, 300] {
        act(width)?;
    }
    share_of_peak(&problem::prior()?);
    estimate(scorings)
}

/// Prints the number of simulation steps per second with 64 aircraft.
fn imagine(model: GreyBox) {
    let mut world = Imagination::new(Arc::new(model), 64, Stratified::new(1, 0, 0.0));
    let action = [Block::zero(); 3];
    let rounds = 20_000;
    let start = clock::now();
    for _ in 0..rounds {
        for block in 0..world.blocks() {
            world.step(block, &action);
        }
    }
    let rate = f64::from(rounds * 64) / (clock::now() - start);
    println!("imagined steps: {:.1} million a second   asked: 1", rate / 1e6);
}

/// Prints the time of one policy evaluation, alone and in SIMD lanes.
fn act(width: usize) -> Result<()> {
    let settings = Hyperparameters { actor: vec![width; 2], ..Hyperparameters::default() };
    let network = Dense::uniform(&settings.actor_sizes(), &mut stream::stream(1, &[]))?;
    let actor = Arc::new(Actor::new(network)?);
    let mut policy = Policy::of(actor.clone());
    let mut seen = Observation {
        time: Time::default(),
        state: State::NEUTRAL,
        incidence_sd: [0.0; 2],
        actuators: ActuatorState::default(),
        altitude: 600.0,
        previous: [Command::IDLE; 2],
    };
    let target = Target { roll: 0.5, pitch: 0.1, airspeed: 16.67 };
    let start = clock::now();
    for _ in 0..20_000 {
        seen.state.roll = 0.1 * policy.command(&seen, &target).aileron;
    }
    let one = 1e6 * (clock::now() - start) / 2e4;
    let (mut units, mut x) = (Units::new(Block::zero()), [Block::from_f64(0.1); OBSERVATIONS]);
    let start = clock::now();
    for _ in 0..2_000 {
        x[0] = actor.act_block(&mut units, &x)[0];
    }
    let block = 1e6 * (clock::now() - start) / 2e3;
    println!(
        "policy of 2 × {width}: {one:.2} us a step   asked: 10; in lanes {block:.2} us for 16"
    );
    Ok(())
}

/// Prints the speed of RK4 steps of the prior without a residual in SIMD lanes, and its fraction of the processor's peak.
fn share_of_peak(prior: &GreyBox) {
    let state = State { roll: 0.2, pitch: 0.1, alpha: 0.05, beta: 0.01, ..State::NEUTRAL };
    let controls =
        Controls { aileron: 0.02, elevator: -0.03, throttle: 0.4, rudder: 0.0, lagged: None };
    let operations = Operations::of_step(prior, &state, &controls);
    let rounds = 9;
    let all = operations.all() as f64;
    let (mut rates, mut shares) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        let most = peak();
        let rate = (0..20).map(|_| steps_per_second(prior, &state, &controls)).fold(0.0, f64::max);
        rates.push(rate);
        shares.push(rate * all / most);
    }
    println!(
        "RK4 of the prior: {:.1} million steps a second, {:.0} % of the peak of {:.0} GFLOP/s   asked: 75",
        median(rates) / 1e6,
        1e2 * median(shares),
        peak() / 1e9
    );
    let Operations { simple, fused, divisions, sines } = operations;
    println!(
        "  a step: {simple} additions and multiplications, {fused} fused, {divisions} divisions, {sines} \
         sines with cosines: {all} operations"
    );
}

/// Estimates the time of the hybrid planner on a Raspberry Pi 5. The time is measured here with vectors of four numbers and
/// scaled by the ratio of the peak performances.
fn estimate(scorings: &[Scoring]) -> Result<()> {
    let most = narrow_peak();
    println!(
        "in vectors of four, peak {:.0} GFLOP/s (a Raspberry Pi 5 core: {:.1})",
        most / 1e9,
        PI_PEAK / 1e9
    );
    for problem in scorings {
        let aids = Aids { agent: Some(problem.agent.clone()), base: None, ilqr: None };
        let settings = Settings { instructions: Instructions::Portable, ..Settings::HYBRID };
        let mut planner = Cem::new("hybrid", &problem.model, settings, aids);
        planner.reset(1);
        let tick = |_| {
            let start = clock::now();
            std::hint::black_box(planner.command(&problem.seen, &problem.target));
            clock::now() - start
        };
        let time = 1e3 * median((0..40).map(tick).collect());
        println!(
            "  hybrid, networks as {}: {time:.2} ms here; ESTIMATE for one core of a Raspberry Pi 5: {:.0} ms",
            problem.name,
            time * most / PI_PEAK
        );
    }
    Ok(())
}
