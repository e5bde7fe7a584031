//! Time on the vehicle's clock.

use std::time::Duration;

/// A time on the vehicle's monotonic clock, in whole microseconds.
///
/// It is a separate type because a companion has three clocks whose times must not be mixed: the vehicle's clock, the monotonic
/// clock of its own computer, and the time of day. All decisions of the pilot use the vehicle's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Time(u64);

impl Time {
    /// The time `us` microseconds after the vehicle's clock was zero.
    pub const fn from_micros(us: u64) -> Self {
        Time(us)
    }
    /// This time in microseconds.
    pub const fn as_micros(self) -> u64 {
        self.0
    }
    /// This time in seconds.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-6
    }
    /// The duration from `earlier` to this time. Zero if `earlier` is later than this time.
    pub fn since(self, earlier: Time) -> Duration {
        Duration::from_micros(self.0.saturating_sub(earlier.0))
    }
    /// This time plus the duration `later`. If the sum is out of range, the result is the largest time.
    pub fn plus(self, later: Duration) -> Self {
        Time(self.0.saturating_add(u64::try_from(later.as_micros()).unwrap_or(u64::MAX)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_that_is_out_of_range_is_the_last_one() {
        let start = Time::from_micros(5);
        assert_eq!(start.plus(Duration::MAX), Time::from_micros(u64::MAX));
        assert_eq!(start.since(Time::from_micros(7)), Duration::ZERO);
    }
}
