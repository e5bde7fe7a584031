//! The processor's time that this process has taken.

/// Seconds on the processor: what else the machine does counts little.
pub fn now() -> f64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the system writes into `time` alone
    let answer = unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut time) };
    assert_eq!(answer, 0, "every Unix has the clock of a process");
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
