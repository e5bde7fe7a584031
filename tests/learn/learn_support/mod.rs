//! What the tests of learning share: models, flights imagined in them, networks.

use std::path::Path;

use greylag::learn::dynamics::windows::Track;
use greylag::model::{GreyBox, Twin};
use greylag::num::{Dense, stream};
use greylag::physics::{Command, State};
use rand::RngExt;

/// A model of the X8.
pub fn model(name: &str) -> GreyBox {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    GreyBox::load(&folder.join(format!("{name}.toml"))).unwrap()
}

/// A flight of `truth` under random commands held for a quarter of a second, as `seen_by` has it.
pub fn flight(truth: &GreyBox, seen_by: &GreyBox, seed: u64, samples: usize) -> Track {
    moved(truth, seen_by, seed, samples, 0.3)
}

/// The same, elevons moving by up to `size` of what they can.
pub fn moved(truth: &GreyBox, seen_by: &GreyBox, seed: u64, samples: usize, size: f64) -> Track {
    let mut rng = stream::stream(seed, &[]);
    let mut twin = Twin::new(State { airspeed: 18.0, ..State::NEUTRAL }, 600.0);
    let mut command = Command::IDLE;
    let rows: Vec<_> = (0..samples)
        .map(|k| {
            if k % 25 == 0 {
                let [aileron, elevator] = [size, size].map(|w| rng.random_range(-w..w));
                command = Command {
                    aileron,
                    elevator,
                    throttle: rng.random_range(0.0..1.0),
                    rudder: 0.0,
                };
            }
            let row = (twin.state, twin.actuators.controls(), twin.altitude);
            twin.step(truth, &command);
            row
        })
        .collect();
    Track::new(seen_by, rows.into_iter())
}

#[allow(dead_code, reason = "not every test needs it")]
/// A network of two hidden layers that is far from silent.
pub fn network(hidden: usize, size: f32) -> Dense {
    let mut rng = stream::stream(11, &[]);
    let mut network = Dense::silent(&[9, hidden, hidden, 8], &mut rng).unwrap();
    let last = network.parameters().len() - (hidden + 1) * 8;
    for p in &mut network.parameters_mut()[last..] {
        *p = size * rng.random_range(-1.0..1.0);
    }
    network
}
