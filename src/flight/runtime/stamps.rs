//! Timestamps of recorded packets: the time of day at the start of the recording plus the time since then on a monotonic
//! clock.

use std::time::{Instant, SystemTime};

/// A packet that arrives up to this many microseconds before the last timestamp gets the next one.
const CROWDED_US: u64 = 100;

/// Timestamps of one recording. A change of the system time in flight has no effect on them. A replay thus sees the same times
/// between packets as the flight. Two successive packets have different timestamps, so that a reader can separate them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stamps {
    started: Instant,
    /// Time of day at the start of the recording, µs since 1970.
    epoch_us: u64,
    last: Option<u64>,
}

impl Stamps {
    /// Timestamps of a recording that started at `started`.
    pub(super) fn since(started: Instant) -> Self {
        Stamps { started, epoch_us: unix_us().saturating_sub(us_since(started)), last: None }
    }

    /// The timestamp of a packet received or sent at `host`, µs since 1970.
    pub(super) fn of(&mut self, host: Instant) -> u64 {
        let us = self.epoch_us + host.saturating_duration_since(self.started).as_micros() as u64;
        let stamp = match self.last {
            Some(last) if (us..us + CROWDED_US).contains(&last) => last + 1,
            _ => us,
        };
        self.last = Some(stamp);
        stamp
    }
}

fn us_since(started: Instant) -> u64 {
    started.elapsed().as_micros() as u64
}

/// The time of day, µs since 1970, as in `.tlog` files.
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
        // two packets in the same microsecond, such as a reply and the next arrival
        let [one, two] = [us(400_000), us(400_000)].map(|at| stamps.of(at));
        assert_eq!(two - one, 1);
        let crowd = [us(500_000); 4].map(|at| stamps.of(at));
        assert!(crowd.windows(2).all(|pair| pair[1] == pair[0] + 1), "{crowd:?}");
        assert!(first.abs_diff(unix_us()) < 10_000_000);
    }
}
