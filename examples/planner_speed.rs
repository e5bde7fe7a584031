//! Measures the computing time per tick of the controllers and counts their memory allocations. Also prints the peak
//! performance of one processor core.
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --example planner_speed
//! ```

#[allow(dead_code, reason = "not every example needs all of it")]
#[path = "side_by_side/processor.rs"]
mod processor;

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use anyhow::Result;

use greylag::control::cem::{Change, Value};
use greylag::control::policy::{ACTIONS, Actor, Agent, Critic, OBSERVATIONS, Origin};
use greylag::control::{self, ControllerKind, Observation, Source, Target};
use greylag::model::residual::{INPUTS, OUTPUTS};
use greylag::model::{GreyBox, Residual};
use greylag::num::{Dense, stream};
use greylag::physics::{ActuatorState, Command, State, Time};

/// The system's allocator with a counter of the allocations.
struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call is passed unchanged to the system's allocator
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: as the caller promises
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Number of ticks that are timed for each controller.
const TICKS: usize = 400;

fn main() -> Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    let mut model = GreyBox::load(&folder.join("prior.toml"))?;
    // a residual of the usual size; its weights do not change the time
    let network = Dense::uniform(&[INPUTS, 64, 64, OUTPUTS], &mut stream::stream(1, &[]))?;
    model.residual =
        Some(Residual::new(network, &model.airframe, model.scale().map(|x| 1e-3 * x))?);
    let agent = agent(&model)?;
    let flops = processor::peak();
    println!("one core's peak, fused multiply-add in single precision: {:.0} GFLOP/s", flops / 1e9);
    println!(
        "{:>19} {:>10} {:>10} {:>10} {:>12}",
        "controller", "p50 ms", "p99 ms", "p99.9 ms", "allocations"
    );
    let fitted = [Change::Value(Value::Fitted)];
    let cores = [Change::Cores(2)];
    for (kind, changes) in [
        (ControllerKind::Policy, &[][..]),
        (ControllerKind::Lqi, &[]),
        (ControllerKind::Cem, &[]),
        (ControllerKind::CemPolicy, &[]),
        (ControllerKind::CemCritic, &[]),
        (ControllerKind::Hybrid, &[]),
        (ControllerKind::Hybrid, &fitted),
        (ControllerKind::Hybrid, &cores),
        (ControllerKind::HybridLqi, &[]),
        (ControllerKind::HybridLqi, &cores),
    ] {
        let mut controller =
            control::build(kind, Source { model: &model, agent: Some(&agent), changes })?;
        controller.reset(1);
        let target = Target { roll: 0.6, pitch: 0.2, airspeed: State::NEUTRAL.airspeed };
        let mut seen = Observation {
            time: Time::default(),
            state: State { alpha: 0.05, ..State::NEUTRAL },
            incidence_sd: [0.0; 2],
            actuators: ActuatorState::default(),
            altitude: 600.0,
            previous: [Command::IDLE; 2],
        };
        let mut times = Vec::with_capacity(TICKS);
        controller.command(&seen, &target);
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        for tick in 0..TICKS {
            seen.state.roll = 0.3 * (0.01 * tick as f64).sin();
            let start = Instant::now();
            std::hint::black_box(controller.command(&seen, &target));
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let allocated = ALLOCATIONS.load(Ordering::Relaxed) - before;
        times.sort_by(f64::total_cmp);
        let at = |q: f64| times[((TICKS - 1) as f64 * q).round() as usize];
        println!(
            "{:>19} {:10.3} {:10.3} {:10.3} {allocated:>12}",
            match changes {
                [] => kind.name().into(),
                [Change::Cores(cores)] => format!("{}, {cores} cores", kind.name()),
                _ => format!("{}, fitted", kind.name()),
            },
            at(0.5),
            at(0.99),
            at(0.999)
        );
    }
    Ok(())
}

/// A policy with random networks of the sizes in Table VII.
fn agent(model: &GreyBox) -> Result<Agent> {
    let mut rng = stream::stream(2, &[]);
    let mut network = |sizes: &[usize]| Dense::uniform(sizes, &mut rng);
    let actor = Actor::new(network(&[OBSERVATIONS, 300, 300, ACTIONS])?)?;
    let sizes = [OBSERVATIONS + ACTIONS, 200, 200, 200, 1];
    let critics = [Critic::new(network(&sizes)?)?, Critic::new(network(&sizes)?)?];
    let origin = Origin {
        schema: Origin::SCHEMA.into(),
        airframe: greylag::model::residual::fingerprint(&model.airframe),
        model: model.name.clone(),
        model_sha256: String::new(),
        seed: 2,
        steps: 0,
        evaluation: None,
        program: "greylag".into(),
    };
    Ok(Agent { actor: actor.into(), critics: Some(critics.into()), origin })
}
