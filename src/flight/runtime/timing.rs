//! Timing statistics of the control loop: the latency of commands and the intervals between state frames.

use std::time::Duration;

/// Number of buckets with a width of 1 µs. One further bucket counts all longer durations.
const RESOLVED_US: usize = 50_000;

/// A histogram of durations, of fixed size.
#[derive(Clone, Debug)]
pub struct Histogram {
    buckets: Box<[u32]>,
    count: u64,
    max_us: f64,
}

impl Default for Histogram {
    fn default() -> Self {
        Histogram { buckets: vec![0; RESOLVED_US + 1].into(), count: 0, max_us: 0.0 }
    }
}

impl Histogram {
    /// Adds a duration to the histogram.
    pub fn note(&mut self, duration: Duration) {
        let us = usize::try_from(duration.as_micros()).unwrap_or(RESOLVED_US);
        self.buckets[us.min(RESOLVED_US)] += 1;
        self.count += 1;
        self.max_us = self.max_us.max(duration.as_nanos() as f64 / 1000.0);
    }

    /// Number of durations added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The largest duration added, µs; 0 if there is none.
    pub fn max_us(&self) -> f64 {
        self.max_us
    }

    /// The quantile `share` (0..1) of the durations in µs, rounded up to a whole microsecond. It is at most 50 001 µs, and NaN if
    /// there are no durations.
    pub fn quantile_us(&self, share: f64) -> f64 {
        let rank = ((share * self.count as f64).ceil() as u64).max(1);
        let mut seen = 0;
        for (us, n) in self.buckets.iter().enumerate() {
            seen += u64::from(*n);
            if seen >= rank {
                return ((us + 1) as f64).min(self.max_us);
            }
        }
        f64::NAN
    }
}

/// Timing statistics of one flight.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// Time from the arrival of a state frame to the sending of its command.
    pub latency: Histogram,
    /// Time between the arrivals of two state frames.
    pub interval: Histogram,
    /// Number of missed cycles. In real time, a cycle is missed if the latency exceeds 10 ms. In lockstep, where the simulator
    /// waits for each command, it is missed if the simulator sent its state again because it had no reply.
    pub missed: u64,
    /// Number of ticks for which the planner gave no command in time, because it was late or busy with an earlier tick.
    pub late_plans: u64,
    /// Number of states that got no reply, because a newer state had already arrived.
    pub overtaken: u64,
    /// Number of stalls: times of more than 0.1 s in which this computer did not run the program.
    pub stalls: u64,
    /// Length of the longest stall.
    pub longest_stall: Duration,
}

impl Timing {
    /// A sentence for the user if this computer was too slow for real time, with the numbers and the remedy; `None` if it was
    /// fast enough.
    pub fn trouble(&self) -> Option<String> {
        let cycles = self.latency.count().max(1) as f64;
        let missed = self.missed as f64 / cycles;
        if self.stalls == 0 && missed < TOO_MANY {
            return None;
        }
        Some(format!(
            "this computer was too slow for real time: late by more than 0.1 s {} times, by {:.1} s at most, and {:.0} % of the \
             commands came more than 10 ms after their state; close other programs and fly again",
            self.stalls,
            self.longest_stall.as_secs_f64(),
            100.0 * missed
        ))
    }
}

/// Fraction of missed cycles from which on the computer counts as too slow.
const TOO_MANY: f64 = 0.02;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_a_thousand_known_durations() {
        let mut histogram = Histogram::default();
        for us in 0..1000 {
            histogram.note(Duration::from_micros(us));
        }
        // half of the durations 0, 1 … 999 µs lie in the buckets up to 499 µs, the last of which ends at 500 µs
        assert_eq!(histogram.quantile_us(0.5), 500.0);
        assert_eq!(histogram.quantile_us(0.99), 990.0);
        assert_eq!(histogram.quantile_us(1.0), 999.0);
        assert_eq!(histogram.max_us(), 999.0);
    }

    #[test]
    fn a_stall_is_kept_as_the_maximum() {
        let mut histogram = Histogram::default();
        histogram.note(Duration::from_secs(3));
        assert_eq!(histogram.max_us(), 3e6);
        assert_eq!(histogram.quantile_us(0.5), 50_001.0);
        assert!(Histogram::default().quantile_us(0.5).is_nan());
    }

    #[test]
    fn a_computer_is_called_slow_for_a_stall_or_for_many_late_commands() {
        let mut timing = Timing::default();
        (0..1000).for_each(|_| timing.latency.note(Duration::from_micros(300)));
        timing.missed = 19;
        assert_eq!(timing.trouble(), None);
        timing.missed = 20;
        assert!(timing.trouble().unwrap().contains("2 % of the commands"));
        (timing.missed, timing.stalls, timing.longest_stall) = (0, 1, Duration::from_millis(1190));
        assert!(timing.trouble().unwrap().contains("1 times, by 1.2 s at most"));
    }
}
