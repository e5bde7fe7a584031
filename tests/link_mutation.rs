//! Hostile bytes: frames mutated by the thousand, fed to parser, client side and vehicle side.

mod link_support;

use std::time::Duration;

use greylag::link::client::Clients;
use greylag::link::framing::StreamCutter;
use greylag::link::vehicle::Sitl;
use link_support::*;
use mavlink::dialects::ardupilotmega::*;
use mavlink::{MavlinkVersion, Message};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Inputs per target.
const INPUTS: u32 = 200_000;

/// One frame of every message that the dialect knows, up to number 400, in both versions, and a
/// third as many frames of what a client really asks.
fn corpus() -> Vec<Vec<u8>> {
    let known = (0..400).filter_map(|id| Some((id, MavMessage::default_message_from_id(id)?)));
    let mut frames: Vec<_> = known
        .flat_map(|(id, message)| {
            let v1 = (id < 256).then(|| frame(MavlinkVersion::V1, &message));
            v1.into_iter().chain([frame(MavlinkVersion::V2, &message)])
        })
        .collect();
    for _ in 0..frames.len() / 12 {
        let setpoint =
            SET_ATTITUDE_TARGET_DATA { q: [1.0, 0.1, 0.1, 0.0], thrust: 0.5, ..Default::default() };
        frames.push(frame(MavlinkVersion::V2, &MavMessage::SET_ATTITUDE_TARGET(setpoint)));
        frames.push(command(400, &[1.0]));
        frames.push(command(511, &[30.0, 1e5]));
        let mut set = vec![0, 0, 0x20, 0x42, 1, 1];
        set.extend(*b"GL_BANK_MAX\0\0\0\0\0\x09");
        frames.push(raw_frame(23, &set));
    }
    frames
}

/// Changes a frame: payload bytes with the CRC made right again (so that it gets past the
/// parser), or any bytes, its length, or its neighbours.
fn mutate(rng: &mut ChaCha8Rng, bytes: &mut Vec<u8>, other: &[u8]) {
    match rng.random_range(0..6u32) {
        0..=2 => {
            let header = if bytes[0] == 0xFE { 6 } else { 10 };
            let end = bytes.len() - 2;
            for _ in 0..rng.random_range(1..12u32) {
                let at = rng.random_range(header..end.max(header + 1));
                bytes[at] = [rng.random(), 0x7F, 0xFF, 0x80, 0, 1][rng.random_range(0..6usize)];
            }
            let id = match header {
                6 => u32::from(bytes[5]),
                _ => u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]),
            };
            let crc = mavlink::calculate_crc(&bytes[1..end], MavMessage::extra_crc(id));
            bytes[end..].copy_from_slice(&crc.to_le_bytes());
        }
        3 => {
            let at = rng.random_range(0..bytes.len());
            bytes[at] ^= 1 << rng.random_range(0..8u32);
        }
        4 => bytes.truncate(rng.random_range(0..bytes.len())),
        _ => {
            let at = rng.random_range(0..=bytes.len());
            bytes.splice(at..at, other.iter().copied());
        }
    }
}

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
    let mut sitl = Sitl::new(1, 0.5);
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
