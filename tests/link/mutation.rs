//! Hostile bytes: frames mutated by the thousand, fed to parser, client side and vehicle side.

use std::time::Duration;

use crate::link_support::hostile::{corpus, mutate};
use crate::link_support::*;
use greylag::link::client::Clients;
use greylag::link::framing::StreamCutter;
use greylag::link::vehicle::Sitl;
use greylag::physics::servos::Travels;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Inputs per target.
const INPUTS: u32 = 200_000;

fn inputs(seed: u64) -> impl Iterator<Item = (u32, Vec<u8>)> {
    let corpus = corpus();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..INPUTS).map(move |i| {
        let mut bytes = corpus[rng.random_range(0..corpus.len())].clone();
        let other = corpus[rng.random_range(0..corpus.len())].clone();
        mutate(&mut rng, &mut bytes, &other);
        if rng.random_range(0..20u32) == 0 {
            rng.fill_bytes(&mut bytes);
        }
        (i, bytes)
    })
}

#[test]
fn the_client_side_survives_mutated_frames() {
    let (mut clients, mut double) = (Clients::new(US), Double::new());
    let mut answers = 0u64;
    for (i, bytes) in inputs(1) {
        let now = at_ms(u64::from(i));
        clients.handle(now, peer((i % 40) as u16), &bytes, &mut double);
        clients.poll(now, &mut double);
        // Everything that leaves is a frame with the right CRC.
        answers += sent(&mut clients).len() as u64;
    }
    let finite = double
        .setpoints
        .iter()
        .all(|s| [s.roll, s.pitch, s.thrust.unwrap_or(0.0)].iter().all(|x| x.is_finite()));
    assert!(finite, "a setpoint that is not finite came through");
    // The inputs did get past the parser, and some of them as far as the autopilot.
    assert!(clients.counts().frames.good > u64::from(INPUTS) / 3, "{:?}", clients.counts());
    assert!(clients.counts().frames.bad() > 1000);
    assert!(answers > u64::from(INPUTS) && !double.setpoints.is_empty() && !double.arms.is_empty());
}

#[test]
fn the_vehicle_side_survives_mutated_frames() {
    let mut sitl = Sitl::new(1, Travels::alike(0.5));
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut delivered = 0u64;
    for i in 0..u64::from(INPUTS) {
        // A state frame with one of its five messages spoilt.
        let mut frames = Shown::at(10_000 * i).frames();
        let (at, other) = (rng.random_range(0..5usize), frames[4].clone());
        mutate(&mut rng, &mut frames[at], &other);
        sitl.handle(Duration::from_millis(10 * i), peer(1), &frames.concat(), |t| {
            delivered += 1;
            assert!(t.state.is_finite() && t.yaw.is_finite() && t.altitude.is_finite());
            assert!(
                t.actuators.aileron.is_finite() && t.specific_force.iter().all(|x| x.is_finite())
            );
            assert!(t.state.airspeed.abs() < 200.0 && t.state.p.abs() < 50.0);
        });
    }
    let counts = sitl.counts();
    // Half of the mutations leave no whole message, many others spoil its time: more than a fifth
    // of the frames must still be complete, or the numbers in them would not be tried.
    assert!(
        delivered > u64::from(INPUTS) / 5 && counts.incomplete > 1000 && counts.faulty > 1000,
        "{counts:?}"
    );
}

#[test]
fn the_stream_cutter_survives_mutated_streams() {
    let mut cutter = StreamCutter::default();
    for (i, bytes) in inputs(3) {
        cutter.push(&bytes, |_| {});
        if i % 7 == 0 {
            cutter.flush(|_| {});
            assert!(!cutter.is_waiting());
        }
    }
    assert!(cutter.counts.good > u64::from(INPUTS) / 3, "{:?}", cutter.counts);
}
