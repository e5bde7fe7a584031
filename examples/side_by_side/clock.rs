//! The processor's time that this process has taken.

use rustix::time::{ClockId, clock_gettime};

/// Seconds on the processor: what else the machine does counts little.
pub fn now() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
