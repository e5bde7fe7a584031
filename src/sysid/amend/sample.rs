//! A simulated flight for tests of fits.

use crate::flight_path::reconstruction::{Instant, Reconstruction, Segment};
use greylag_model::{GreyBox, Memory};
use greylag_physics::{Controls, State};

/// The shipped model of the simulator's X8.
pub fn model() -> GreyBox {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/x8/jsbsim.toml");
    GreyBox::load(std::path::Path::new(path)).unwrap()
}

/// A flight of `model` with `count` samples at 100 Hz, without noise, and with sinusoidal deflections. `phase` (s) shifts the
/// deflections. The stated standard deviations are 0.001.
pub fn flight(model: &GreyBox, name: &str, count: u32, phase: f64) -> Reconstruction {
    let mut state = State { airspeed: 18.0, alpha: 0.05, pitch: 0.05, ..State::NEUTRAL };
    let mut memory = Memory::default();
    let instants = (0..count).map(|k| {
        let time_s = 0.01 * f64::from(k);
        let t = time_s + phase;
        let controls = Controls {
            aileron: 0.04 * (3.1 * t).sin(),
            elevator: -0.03 + 0.03 * (2.3 * t).cos(),
            throttle: 0.5 + 0.2 * (0.7 * t).sin(),
            ..Controls::default()
        };
        let at = Instant { controls, ..instant(time_s, state) };
        state = model.step(&state, &controls, 600.0, &mut memory);
        at
    });
    reconstruction(name, instants.collect())
}

/// A sample at `time_s` (s) without forces and with deflections of zero.
pub fn instant(time_s: f64, state: State) -> Instant {
    Instant {
        time_s,
        state,
        yaw: f64::NAN,
        controls: Controls::default(),
        command: None,
        specific_force: [f64::NAN; 3],
        altitude: 600.0,
        density: 1.225,
    }
}

/// A flight of `instants` with stated standard deviations of 0.001, and of 0.1 m/s² for the forces.
pub fn reconstruction(name: &str, instants: Vec<Instant>) -> Reconstruction {
    Reconstruction {
        segments: vec![Segment { instants }],
        noise: [1e-3; 8],
        left: [1e-3; 8],
        force_noise: [0.1; 3],
        ..Reconstruction::empty(name)
    }
}
