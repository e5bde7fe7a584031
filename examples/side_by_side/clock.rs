//! Processor time of this process.

use rustix::time::{ClockId, clock_gettime};

/// Processor time of this process so far, s. Other programs hardly affect it.
pub fn now() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
