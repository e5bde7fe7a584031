//! Fuzzing: seeded mutations of good inputs, fed to everything that reads what others have written.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use greylag::link::client::Clients;
use greylag::link::framing::{FrameCounts, Frames, StreamCutter};
use greylag::link::routing::Router;
use greylag::link::signing::{Key, Signer};
use greylag::link::vehicle::{Authority, Profile, Real, Sitl, Stack};
use greylag::model::{GreyBox, weights};
use greylag::num::Dense;
use greylag::num::stream::stream;
use greylag::physics::Airframe;
use greylag::physics::servos::Travels;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::link_support::hostile::{corpus, mutate};
use crate::link_support::{Double, US, at_ms, peer};

/// Inputs of one seed: what a panic throws away, and what a report names.
const BATCH: u64 = 100_000;

/// What is fed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Frames cut out of datagrams and streams.
    Parser,
    /// The client side: commands, parameters, setpoints, missions; routing.
    Clients,
    /// The vehicle side of the simulator's profile.
    Sitl,
    /// The vehicle side of real controllers.
    Real,
    /// Signatures.
    Signing,
    /// Model and airframe files.
    Toml,
    /// Network files.
    Safetensors,
}

impl Target {
    pub const ALL: [Target; 7] = [
        Target::Parser,
        Target::Clients,
        Target::Sitl,
        Target::Real,
        Target::Signing,
        Target::Toml,
        Target::Safetensors,
    ];
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Target::ALL.into_iter().find(|target| target.to_string() == text);
        found.ok_or_else(|| format!("{text}: known are {:?}", Target::ALL))
    }
}

/// What came of a target's inputs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fed {
    /// Inputs.
    pub inputs: u64,
    /// Those that were taken for what they were made from: frames, states, files.
    pub taken: u64,
    /// Seeds of batches in which something panicked, with their number.
    pub panics: u64,
}

/// Feeds `inputs` inputs of seeds from `seed` on, a hundred thousand each.
pub fn feed(target: Target, inputs: u64, seed: u64) -> Fed {
    let mut fed = Fed::default();
    let mut batch = 0;
    while fed.inputs < inputs {
        let count = BATCH.min(inputs - fed.inputs);
        match catch_unwind(AssertUnwindSafe(|| run(target, count, seed + batch))) {
            Ok(taken) => fed.taken += taken,
            Err(_) => {
                println!("PANIC: {target}, seed {}, {count} inputs", seed + batch);
                fed.panics += 1;
            }
        }
        fed.inputs += count;
        batch += 1;
    }
    fed
}

fn run(target: Target, inputs: u64, seed: u64) -> u64 {
    let rng = ChaCha8Rng::seed_from_u64(seed);
    match target {
        Target::Parser => parser(inputs, rng),
        Target::Clients => clients(inputs, rng),
        Target::Sitl => sitl(inputs, rng),
        Target::Real => real(inputs, rng),
        Target::Signing => signing(inputs, rng),
        Target::Toml => models(inputs, rng),
        Target::Safetensors => networks(inputs, rng),
    }
}

/// Hands out spoilt frames.
fn frames(inputs: u64, mut rng: ChaCha8Rng, mut take: impl FnMut(u64, &[u8], &mut ChaCha8Rng)) {
    let corpus = corpus();
    let mut bytes = Vec::new();
    for i in 0..inputs {
        bytes.clear();
        bytes.extend_from_slice(&corpus[rng.random_range(0..corpus.len())]);
        let other = &corpus[rng.random_range(0..corpus.len())];
        mutate(&mut rng, &mut bytes, other);
        if rng.random_range(0..20u32) == 0 {
            rng.fill_bytes(&mut bytes);
        }
        take(i, &bytes, &mut rng);
    }
}

fn parser(inputs: u64, rng: ChaCha8Rng) -> u64 {
    let (mut cutter, mut counts) = (StreamCutter::default(), FrameCounts::default());
    frames(inputs, rng, |i, bytes, _| match i % 2 {
        0 => {
            let held: usize = Frames::new(bytes, &mut counts).map(|f| f.bytes.len()).sum();
            assert!(held <= bytes.len());
        }
        _ => {
            cutter.push(bytes, |frame| assert!(frame.payload.len() <= 255));
            if i % 15 == 0 {
                cutter.flush(|_| {});
            }
        }
    });
    counts.good + cutter.counts.good
}

fn clients(inputs: u64, rng: ChaCha8Rng) -> u64 {
    let (mut clients, mut double) = (Clients::new(US), Double::new());
    let mut router = Router::default();
    frames(inputs, rng, |i, bytes, _| {
        let (now, from) = (at_ms(i), peer((i % 40) as u16));
        clients.handle(now, from, bytes, &mut double);
        router.learn(now.host, from, bytes);
        router.to_controller(bytes, clients.identity(), i % 3 == 0);
        router.to_client(bytes, from);
        if i % 8 == 0 {
            clients.poll(now, &mut double);
            assert!(clients.drain().all(|(_, frame)| frame.len() <= 300));
        }
        let set = double.setpoints.drain(..);
        set.for_each(|s| assert!(s.roll.is_finite() && s.pitch.is_finite()));
        for s in double.sticks.drain(..) {
            assert!([s.roll, s.pitch, s.throttle].iter().all(|x| x.is_finite()));
        }
        double.arms.clear();
        double.modes.clear();
    });
    clients.counts().frames.good
}

fn sitl(inputs: u64, rng: ChaCha8Rng) -> u64 {
    let mut vehicle = Sitl::new(1, Travels::alike(0.5));
    let mut states = 0;
    vehicle_frames(inputs, rng, (1, 200), |host, bytes| {
        vehicle.handle(host, peer(1), bytes, |t| {
            states += 1;
            assert!(t.state.is_finite() && t.altitude.is_finite());
        });
    });
    states
}

fn real(inputs: u64, rng: ChaCha8Rng) -> u64 {
    let airframe = Airframe::load(Path::new("params/x8/airframe.toml")).unwrap();
    let seen = |stack| {
        let actuators = airframe.actuators;
        Real::new(Profile { stack, authority: Authority::Surfaces, actuators })
    };
    let mut vehicles = [seen(Stack::Px4), seen(Stack::Ardupilot)];
    let mut states = 0;
    let mut i = 0usize;
    vehicle_frames(inputs, rng, (1, 1), |host, bytes| {
        i += 1;
        let vehicle = &mut vehicles[i % 2];
        vehicle.handle(host, peer(1), bytes, |t| {
            states += 1;
            assert!(t.state.is_finite() && t.altitude.is_finite());
        });
        vehicle.due(host);
        while vehicle.take_notice().is_some() {}
    });
    states
}

/// Spoilt frames of a vehicle: by themselves, then with what makes a state whole again.
fn vehicle_frames(
    inputs: u64,
    mut rng: ChaCha8Rng,
    (system, component): (u8, u8),
    mut take: impl FnMut(Duration, &[u8]),
) {
    use crate::link_support::{Shown, frame_from};
    use mavlink::MavlinkVersion::V2;
    use mavlink::dialects::ardupilotmega::*;
    let beat = |autopilot| {
        let message = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            autopilot,
            mavtype: MavType::MAV_TYPE_FIXED_WING,
            base_mode: MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED,
            ..Default::default()
        });
        frame_from(V2, system, component, &message)
    };
    let beats =
        [beat(MavAutopilot::MAV_AUTOPILOT_PX4), beat(MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA)];
    for i in 0..inputs {
        let host = Duration::from_millis(10 * i);
        if i % 64 < 2 {
            take(host, &beats[i as usize % 2]);
        }
        let Shown { imu, air, incidence, actuators, attitude } = Shown::at(10_000 * i);
        let mut frames = [
            MavMessage::HIGHRES_IMU(imu),
            MavMessage::VFR_HUD(air),
            MavMessage::AOA_SSA(incidence),
            MavMessage::ACTUATOR_OUTPUT_STATUS(actuators),
            MavMessage::ATTITUDE_QUATERNION(attitude),
        ]
        .map(|message| frame_from(V2, system, component, &message));
        let (at, other) = (rng.random_range(0..5usize), frames[4].clone());
        mutate(&mut rng, &mut frames[at], &other);
        take(host, &frames.concat());
    }
}

fn signing(inputs: u64, rng: ChaCha8Rng) -> u64 {
    let now_us = 1_795_000_000_000_000;
    let mut us = Signer::new(Key::from_bytes([1; 32]), 0);
    let mut them = Signer::new(Key::from_bytes([1; 32]), 0);
    frames(inputs, rng, |i, bytes, rng| {
        let mut signed = us.sign(now_us + i, (i % 3) as u8, bytes);
        if i % 2 == 0 && !signed.is_empty() {
            let at = rng.random_range(0..signed.len());
            signed[at] ^= 1 << rng.random_range(0..8u32);
        }
        let believed = them.believed(now_us + i, &signed);
        assert!(believed.len() <= signed.len());
    });
    them.counts().believed
}

/// Spoils a file: bytes, pieces, numbers, names.
fn spoil(rng: &mut ChaCha8Rng, bytes: &mut Vec<u8>) {
    const WORDS: [&[u8]; 16] = [
        b"nan",
        b"-inf",
        b"1e400",
        b"0",
        b"-1",
        b"[",
        b"]",
        b"=",
        b"\n",
        b"\"",
        b"true",
        b"{}",
        b"18446744073709551616",
        b"\xFF\xFE",
        b"[effects.stall]\n",
        b"../../",
    ];
    for _ in 0..rng.random_range(1..4u32) {
        if bytes.is_empty() {
            return;
        }
        let at = rng.random_range(0..bytes.len());
        match rng.random_range(0..5u32) {
            0 => bytes[at] ^= 1 << rng.random_range(0..8u32),
            1 => {
                let end = (at + rng.random_range(1..40usize)).min(bytes.len());
                bytes.drain(at..end);
            }
            2 => {
                let word = WORDS[rng.random_range(0..WORDS.len())];
                bytes.splice(at..(at + word.len()).min(bytes.len()), word.iter().copied());
            }
            3 => {
                let end = (at + rng.random_range(1..80usize)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                let to = rng.random_range(0..=bytes.len());
                bytes.splice(to..to, piece);
            }
            _ => bytes[at] = [rng.random(), 0, b'9', b'-', b'.', 0xFF][rng.random_range(0..6usize)],
        }
    }
}

fn models(inputs: u64, mut rng: ChaCha8Rng) -> u64 {
    let folder = Path::new("params/x8");
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    let files = ["jsbsim.toml", "prior.toml", "airframe.toml"].map(read);
    let path = folder.join("fuzzed.toml");
    let mut taken = 0;
    for i in 0..inputs {
        let which = i as usize % files.len();
        let mut bytes = files[which].clone();
        spoil(&mut rng, &mut bytes);
        // Files are read as text: what is no UTF-8 ends there.
        let text = String::from_utf8_lossy(&bytes);
        let good = match which {
            2 => Airframe::parse(&text).is_ok(),
            _ => GreyBox::parse(&text, &path).is_ok(),
        };
        taken += u64::from(good);
    }
    taken
}

fn networks(inputs: u64, mut rng: ChaCha8Rng) -> u64 {
    let network = Dense::uniform(&[9, 8, 6], &mut stream(3, &[])).unwrap();
    let said: Vec<u64> = vec![7; 4];
    let file = weights::to_bytes(&network, None, &said).unwrap();
    let mut taken = 0;
    for _ in 0..inputs {
        let mut bytes = file.clone();
        spoil(&mut rng, &mut bytes);
        // The length of the header and what it says are worth spoiling more often than weights.
        if rng.random_range(0..3u32) == 0 {
            let at = rng.random_range(0..bytes.len().clamp(1, 400));
            if let Some(byte) = bytes.get_mut(at) {
                *byte = rng.random();
            }
        }
        let said = weights::origin::<Vec<u64>>(&bytes);
        taken += u64::from(weights::network(&bytes).is_ok() && said.is_ok());
    }
    taken
}
