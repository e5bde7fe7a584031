//! One direction of a simulated link, to which the active faults are applied.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::mix::{Fault, FaultKind};

/// One direction of a link, in steps of 10 ms.
pub struct Wire {
    random: ChaCha8Rng,
    /// Batches in transit: arrival step and bytes.
    under_way: Vec<(u64, Vec<u8>)>,
}

impl Wire {
    /// One `direction` of the link in the flight with `seed`. Each direction has its own random stream.
    pub fn new(seed: u64, direction: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(10 + direction);
        Wire { random, under_way: Vec::new() }
    }

    /// Sends `bytes` as one batch at `step`, under the active `faults`.
    pub fn send(&mut self, step: u64, mut bytes: Vec<u8>, faults: &[Fault]) {
        let mut arrives = step;
        let mut copies = 1;
        for fault in faults {
            let s = fault.strength;
            match fault.kind {
                FaultKind::Unplug => return,
                FaultKind::Loss if self.chance(0.05 + 0.6 * s) => return,
                FaultKind::Duplication if self.chance(0.1 + 0.8 * s) => copies = 2,
                FaultKind::Reordering if self.chance(0.1 + 0.4 * s) => {
                    arrives += self.random.random_range(1..=1 + (4.0 * s) as u64);
                }
                FaultKind::Delay if self.chance(0.02 + 0.1 * s) => {
                    arrives += self.random.random_range(2..=5 + (30.0 * s) as u64);
                }
                FaultKind::Corruption if self.chance(0.1 + 0.8 * s) => self.flip(&mut bytes, s),
                FaultKind::Truncation if self.chance(0.1 + 0.6 * s) => {
                    let length = self.random.random_range(0..=bytes.len());
                    bytes.truncate(length);
                }
                FaultKind::Flood => {
                    for _ in 0..10 {
                        let garbage = self.garbage(&bytes);
                        self.under_way.push((step, garbage));
                    }
                }
                _ => {}
            }
        }
        (0..copies).for_each(|_| self.under_way.push((arrives, bytes.clone())));
    }

    /// The batches that have arrived by `step`, in the order in which they were sent.
    pub fn receive(&mut self, step: u64) -> Vec<Vec<u8>> {
        let (now, later) =
            std::mem::take(&mut self.under_way).into_iter().partition(|(at, _)| *at <= step);
        self.under_way = later;
        now.into_iter().map(|(_, bytes): (u64, Vec<u8>)| bytes).collect()
    }

    fn chance(&mut self, probability: f64) -> bool {
        self.random.random::<f64>() < probability
    }

    fn flip(&mut self, bytes: &mut [u8], strength: f64) {
        if bytes.is_empty() {
            return;
        }
        for _ in 0..1 + (8.0 * strength) as usize {
            let at = self.random.random_range(0..bytes.len());
            bytes[at] ^= 1 << self.random.random_range(0..8);
        }
    }

    /// Noise, an incomplete frame, or a frame of another system.
    fn garbage(&mut self, good: &[u8]) -> Vec<u8> {
        match self.random.random_range(0..3) {
            0 => (0..self.random.random_range(1..300)).map(|_| self.random.random()).collect(),
            1 => good[..good.len() / 2].to_vec(),
            _ => {
                let mut bytes = good.to_vec();
                if let Some(system) = bytes.get_mut(5) {
                    *system = system.wrapping_add(7);
                }
                bytes
            }
        }
    }
}
