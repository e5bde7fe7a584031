//! Frame faults: which state frames are lost, which come late.

use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::options::FrameFaults;

/// Draws losses and delays of frames from separate random streams, so that neither changes the other.
#[derive(Clone, Debug)]
pub struct Faults {
    rule: FrameFaults,
    drops: ChaCha8Rng,
    delays: ChaCha8Rng,
}

impl Faults {
    /// Faults whose draws are fixed by `seed`.
    pub fn new(rule: FrameFaults, seed: u64) -> Self {
        let stream = |number| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(number);
            random
        };
        Faults { rule, drops: stream(2), delays: stream(3) }
    }

    /// Whether the next sending is lost.
    pub fn drops(&mut self) -> bool {
        self.drops.random::<f64>() < self.rule.drop_probability
    }

    /// Random delay of the next frame beyond the constant delay.
    pub fn lateness(&mut self) -> Duration {
        let jitter = self.delays.random::<f64>() * self.rule.jitter_ms;
        let late = self.delays.random::<f64>() < self.rule.late_probability;
        milliseconds(jitter + if late { self.rule.late_ms } else { 0.0 })
    }
}

/// A duration from milliseconds that are known to be finite, positive or zero, and bounded.
pub(super) fn milliseconds(ms: f64) -> Duration {
    Duration::from_secs_f64(ms * 1e-3)
}
