//! Frame faults: draws which state frames are lost and which are delayed.

use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::options::FrameFaults;

/// Draws frame losses and delays from separate random streams, so a change of one does not change the other.
#[derive(Clone, Debug)]
pub struct Faults {
    rule: FrameFaults,
    drops: ChaCha8Rng,
    delays: ChaCha8Rng,
}

impl Faults {
    /// Faults by `rule`, whose draws depend only on `seed`.
    pub fn new(rule: FrameFaults, seed: u64) -> Self {
        let stream = |number| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(number);
            random
        };
        Faults { rule, drops: stream(2), delays: stream(3) }
    }

    /// Draws whether the next frame is lost.
    pub fn drops(&mut self) -> bool {
        self.drops.random::<f64>() < self.rule.drop_probability
    }

    /// Draws the random delay of the next frame, in addition to the constant delay.
    pub fn lateness(&mut self) -> Duration {
        let jitter = self.delays.random::<f64>() * self.rule.jitter_ms;
        let late = self.delays.random::<f64>() < self.rule.late_probability;
        milliseconds(jitter + if late { self.rule.late_ms } else { 0.0 })
    }
}

/// A duration from milliseconds, which must be finite, not negative and bounded.
pub(super) fn milliseconds(ms: f64) -> Duration {
    Duration::from_secs_f64(ms * 1e-3)
}
