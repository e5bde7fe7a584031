//! Time on the vehicle's clock.

use std::time::Duration;

/// A moment on the vehicle's monotonic clock, in whole microseconds.
///
/// A type of its own because a companion meets three clocks (vehicle, host, wall) and must never
/// subtract one from another by accident; only vehicle time drives decisions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Time(u64);

impl Time {
    /// A moment `us` microseconds after the vehicle's start.
    pub const fn from_micros(us: u64) -> Self {
        Time(us)
    }
    /// Microseconds since the vehicle's start.
    pub const fn as_micros(self) -> u64 {
        self.0
    }
    /// Seconds since the vehicle's start.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-6
    }
    /// The time passed since `earlier`; zero if `earlier` lies in the future.
    pub fn since(self, earlier: Time) -> Duration {
        Duration::from_micros(self.0.saturating_sub(earlier.0))
    }
    /// The moment `later` after this one.
    pub fn plus(self, later: Duration) -> Self {
        Time(self.0.saturating_add(later.as_micros() as u64))
    }
}
