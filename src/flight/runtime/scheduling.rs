//! Wake-up latency of this computer, and the real-time scheduling class. The wake-up latency is the delay with which a sleeping
//! thread runs again.

use std::fmt;
use std::io;
use std::time::{Duration, Instant};

use super::timing::Histogram;

/// Priority of the companion's threads within SCHED_FIFO (1..99). It is below that of the kernel's interrupt threads (50).
const PRIORITY: i32 = 40;
/// Period of the wake-up measurement.
const CYCLE: Duration = Duration::from_millis(10);
/// Limits of the wake-up latency. At most one wake-up in a hundred may exceed the first limit, and none may exceed the second. In
/// a control cycle of 10 ms, a planner (a controller that optimises a sequence of commands) has 8 ms to compute its command. The
/// other 2 ms remain for the rest of the loop.
const LATE: (Duration, Duration) = (Duration::from_millis(2), Duration::from_millis(5));

/// Puts this thread, and all threads that it starts, into the scheduling class SCHED_FIFO. A thread of this class runs
/// before all threads of the default class.
///
/// # Errors
///
/// If the system does not permit real-time scheduling, or has no such class.
pub fn take_real_time() -> io::Result<()> {
    #[cfg(target_os = "linux")]
    {
        let parameters = libc::sched_param { sched_priority: PRIORITY };
        // SAFETY: the call reads the structure, which outlives the call, and changes this thread only.
        let result =
            unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) };
        if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
    }
    #[cfg(not(target_os = "linux"))]
    Err(io::Error::from(io::ErrorKind::Unsupported))
}

/// Wake-up latency of a thread that sleeps for 10 ms at a time.
#[derive(Clone, Debug, Default)]
pub struct Punctuality {
    late: Histogram,
}

impl Punctuality {
    /// Measures the wake-up latency of the calling thread for `length`.
    pub fn measure(length: Duration) -> Self {
        let mut late = Histogram::default();
        let start = Instant::now();
        let mut due = start;
        while start.elapsed() < length {
            due += CYCLE;
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            let woken = Instant::now();
            late.note(woken.saturating_duration_since(due));
            // wake-ups that were missed during a long delay are skipped
            due = due.max(woken.checked_sub(CYCLE).unwrap_or(woken));
        }
        Punctuality { late }
    }

    /// Adds a wake-up that was late by `late`.
    pub fn note(&mut self, late: Duration) {
        self.late.note(late);
    }

    /// Whether the latency suffices for flight: at most 2 ms for 99 % of the wake-ups, and at most 5 ms for all.
    pub fn is_good(&self) -> bool {
        let us = |limit: Duration| limit.as_secs_f64() * 1e6;
        self.late.quantile_us(0.99) <= us(LATE.0) && self.late.max_us() <= us(LATE.1)
    }

    /// Advice for the user if the latency is too high, one sentence for each remedy. Empty if the latency suffices.
    pub fn advice(&self, class: Class) -> Vec<String> {
        if self.is_good() {
            return Vec::new();
        }
        let mut advice = vec![format!("close other programs{}", load())];
        if class == Class::Usual && cfg!(target_os = "linux") {
            advice.push("fly with --realtime, which puts the companion before them".into());
        }
        advice.extend(governor());
        advice
    }
}

impl fmt::Display for Punctuality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "wakes from 10 ms of sleep {:.1} ms late (median), {:.1} ms (1 in 100), {:.1} ms (longest)",
            self.late.quantile_us(0.5) / 1000.0,
            self.late.quantile_us(0.99) / 1000.0,
            self.late.max_us() / 1000.0
        )
    }
}

/// Scheduling class of the companion's threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// The default class of the operating system.
    Usual,
    /// The real-time class SCHED_FIFO.
    RealTime,
}

fn load() -> String {
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    load.split(' ')
        .next()
        .filter(|load| !load.is_empty())
        .map_or_else(String::new, |load| format!(" (load {load} on {processors} processors)"))
}

/// Advice on the processor's frequency governor, if it is not `performance`; `None` if it is or if it is unknown.
fn governor() -> Option<String> {
    let path = "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor";
    let governor = std::fs::read_to_string(path).ok()?;
    let governor = governor.trim();
    (governor != "performance").then(|| {
        format!("let the processor run at full clock: sudo cpupower frequency-set -g performance (now {governor})")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn woken(late_ms: &[u64]) -> Punctuality {
        let mut punctuality = Punctuality::default();
        late_ms.iter().for_each(|ms| punctuality.note(Duration::from_millis(*ms)));
        punctuality
    }

    #[test]
    fn a_computer_that_wakes_within_two_milliseconds_gets_no_advice() {
        let good = woken(&[1; 200]);
        assert!(good.is_good() && good.advice(Class::Usual).is_empty());
        assert!(!woken(&[&[1; 199][..], &[6]].concat()).is_good(), "one of 6 ms");
        assert!(!woken(&[&[0; 190][..], &[3; 10]].concat()).is_good(), "one in twenty of 3 ms");
    }

    #[test]
    fn real_time_is_advised_to_whoever_does_not_have_it() {
        let bad = woken(&[&[1; 199][..], &[30]].concat());
        let names = |class| bad.advice(class).iter().any(|line| line.contains("--realtime"));
        assert!(names(Class::Usual) && !names(Class::RealTime));
        assert!(bad.to_string().contains("30.0 ms (longest)"), "{bad}");
    }

    #[test]
    fn two_tenths_of_a_second_are_twenty_wakings_at_most() {
        let measured = Punctuality::measure(Duration::from_millis(200));
        assert!((1..=20).contains(&measured.late.count()), "{}", measured.late.count());
    }
}
