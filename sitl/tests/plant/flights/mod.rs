//! Flights and plants that several tests use.
#![allow(dead_code)] // Each test that includes this module uses a part of it.

pub mod golden;

use greylag_sitl::air::Air;
use greylag_sitl::plant::{DT_S, Inputs, Plant, PlantOptions, Truth};

/// Surfaces centred and throttle closed.
pub const IDLE: Inputs = Inputs { aileron: 0.0, elevator: 0.0, throttle: 0.0, rudder: 0.0 };

/// The built-in X8 in calm air at the neutral start.
pub fn plant() -> Plant {
    plant_in(Air::default())
}

/// The built-in X8 in `air` at the neutral start.
pub fn plant_in(air: Air) -> Plant {
    Plant::new(&PlantOptions { air, ..PlantOptions::default() }).expect("the built-in X8 loads")
}

/// The built-in X8 in calm air with `effects` hidden in it, each as `id=amplitude`.
pub fn plant_with(effects: &[&str]) -> Plant {
    let hidden = effects.iter().map(|text| text.parse().expect("a known effect")).collect();
    Plant::new(&PlantOptions { hidden, ..PlantOptions::default() })
        .expect("the X8 takes the effects")
}

/// Command number `k` of a history that moves every actuator at every step.
pub fn busy(k: u32) -> Inputs {
    let t = f64::from(k) * DT_S;
    Inputs {
        aileron: 0.3 * (3.1 * t).sin(),
        elevator: 0.15 * (1.7 * t).cos(),
        throttle: 0.4 + 0.3 * (0.9 * t).sin(),
        rudder: 0.0,
    }
}

/// States of a flight with the commands of `busy` from step `from` up to but not including `to`.
pub fn fly(plant: &mut Plant, from: u32, to: u32) -> Vec<Truth> {
    (from..to).map(|k| plant.step(busy(k)).expect("a gentle flight stays finite")).collect()
}

/// Makes `steps` steps with constant `inputs`; returns the last state.
pub fn hold(plant: &mut Plant, inputs: Inputs, steps: u32) -> Truth {
    for _ in 0..steps {
        plant.step(inputs).expect("a gentle flight stays finite");
    }
    plant.truth()
}

/// Asserts that two flights are bit-identical; otherwise prints the first step with a difference.
pub fn assert_same(a: &[Truth], b: &[Truth]) {
    assert_eq!(a.len(), b.len());
    if let Some(k) = (0..a.len()).find(|k| a[*k] != b[*k]) {
        panic!("the flights part at step {k}:\n{:?}\n{:?}", a[k], b[k]);
    }
}

/// Whether two flights differ at any step.
pub fn differ(a: &[Truth], b: &[Truth]) -> bool {
    a != b
}
