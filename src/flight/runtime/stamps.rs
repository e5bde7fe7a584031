//! The stamps of recorded packets: the time of day at the start, carried on by a clock that never jumps.

use std::time::{Instant, SystemTime};

/// Stamps of one recording. A time of day that is set in flight does not show in them, so that a replay
/// sees the ages that the flight saw; no two packets in a row have the same, which keeps them apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stamps {
    started: Instant,
    /// µs since 1970 at the start.
    epoch_us: u64,
    last: Option<u64>,
}

impl Stamps {
    /// Stamps of a recording that began at `started`, a moment ago.
    pub(super) fn since(started: Instant) -> Self {
        Stamps { started, epoch_us: unix_us().saturating_sub(us_since(started)), last: None }
    }

    /// The stamp of a packet that arrived, or left, at `host`, µs since 1970.
    pub(super) fn of(&mut self, host: Instant) -> u64 {
        let us = self.epoch_us + host.saturating_duration_since(self.started).as_micros() as u64;
        let stamp = if self.last == Some(us) { us + 1 } else { us };
        self.last = Some(stamp);
        stamp
    }
}

fn us_since(started: Instant) -> u64 {
    started.elapsed().as_micros() as u64
}

/// Microseconds since 1970, as `.tlog` counts them.
pub(super) fn unix_us() -> u64 {
    SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0, |since| since.as_micros() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn stamps_keep_the_distances_of_arrivals_and_packets_apart() {
        let started = Instant::now();
        let mut stamps = Stamps::since(started);
        let us = |us| started + Duration::from_micros(us);
        let first = stamps.of(us(1000));
        assert_eq!(stamps.of(us(301_000)) - first, 300_000);
        // An answer that has left in the microsecond of the next arrival.
        let [one, two] = [us(400_000), us(400_000)].map(|at| stamps.of(at));
        assert_eq!(two - one, 1);
        assert!(first.abs_diff(unix_us()) < 10_000_000);
    }
}
