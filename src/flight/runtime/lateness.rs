//! Whether this computer ran when it should have: stalls of the control and of the network thread, in words with their cause.

use std::time::{Duration, Instant};

/// A thread that wakes later than this has not run when it should have: ten cycles.
const LATE: Duration = Duration::from_millis(100);
/// The longest time between two looks of a thread that runs: it looks once a cycle at least.
const USUAL: Duration = Duration::from_millis(10);
/// Least time between two lines about it.
const SAID_AGAIN: Duration = Duration::from_secs(5);
/// From this share of a stall on that the thread was ready to run, other work had the processor.
const BUSY: f64 = 0.5;

/// Which thread did not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Behind {
    /// The control thread, and so probably the whole program.
    Control,
    /// The network thread alone: the control thread ran beside it.
    Network,
}

/// Looks whether the threads that listen have run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attention {
    /// Last look of the control thread.
    looked: Instant,
    /// Rounds of the network thread, and when the control thread saw them grow.
    network: (u64, Instant),
}

impl Attention {
    pub(super) fn new(host: Instant) -> Self {
        Attention { looked: host, network: (0, host) }
    }

    /// A look at `host`, with the rounds of the network thread: since when nobody has listened, if it is too long.
    pub(super) fn look(&mut self, host: Instant, rounds: u64) -> Option<(Behind, Instant)> {
        let looked = std::mem::replace(&mut self.looked, host);
        if rounds != self.network.0 {
            self.network = (rounds, host);
        }
        let late = |since: Instant| host.saturating_duration_since(since) > LATE;
        match (late(looked), late(self.network.1)) {
            (true, _) => Some((Behind::Control, looked)),
            (false, true) => Some((Behind::Network, self.network.1)),
            (false, false) => None,
        }
    }

    /// Both threads listen again at `host`.
    pub(super) fn resume(&mut self, host: Instant, rounds: u64) {
        *self = Attention { looked: host, network: (rounds, host) };
    }
}

/// How late this computer was for a stall that began at `since` and ended at `host`.
pub(super) fn lateness(since: Instant, host: Instant) -> Duration {
    host.saturating_duration_since(since).saturating_sub(USUAL)
}

/// Why a thread did not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cause {
    /// It was ready to run, and something else ran.
    Busy,
    /// It was not to run.
    Stopped,
    /// Nothing tells.
    Unknown,
}

/// Time for which this thread was ready to run and did not, as the system's scheduler counts it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Waited(Option<Duration>);

impl Waited {
    /// Asks the system; nothing where it does not tell.
    pub(super) fn now() -> Self {
        let counted = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
        Waited(
            counted
                .and_then(|words| words.split(' ').nth(1)?.parse().ok())
                .map(Duration::from_nanos),
        )
    }

    /// Why the thread was late by `missed`, by what it has waited since `self`.
    pub(super) fn cause(self, now: Waited, missed: Duration) -> Cause {
        match (self.0, now.0) {
            (Some(before), Some(after)) => {
                let waited = after.saturating_sub(before);
                if waited >= missed.mul_f64(BUSY) { Cause::Busy } else { Cause::Stopped }
            }
            _ => Cause::Unknown,
        }
    }
}

/// What is said of stalls: each at once, unless one was said a moment ago; then all of five seconds together.
#[derive(Clone, Debug, Default)]
pub(super) struct Reports {
    /// When the last line was said.
    said: Option<Instant>,
    /// Stalls since then, and the longest.
    unsaid: (u32, Duration),
}

impl Reports {
    /// A stall that ended at `host`; what is to be said of it at once.
    pub(super) fn note(&mut self, host: Instant, missed: Duration, cause: Cause) -> Option<String> {
        if self.said.is_some_and(|said| host.saturating_duration_since(said) < SAID_AGAIN) {
            self.unsaid = (self.unsaid.0 + 1, self.unsaid.1.max(missed));
            return None;
        }
        self.said = Some(host);
        let late = format!("this computer was late by {:.1} s", missed.as_secs_f64());
        Some(match cause {
            Cause::Busy => format!("{late}: {}", busy()),
            Cause::Stopped => format!("{late}: the program was stopped, or the machine suspended"),
            Cause::Unknown => late,
        })
    }

    /// What is to be said at `host` of stalls that were not said yet.
    pub(super) fn due(&mut self, host: Instant) -> Option<String> {
        let (times, longest) = self.unsaid;
        let waits = self.said.is_none_or(|said| host.saturating_duration_since(said) < SAID_AGAIN);
        if times == 0 || waits {
            return None;
        }
        (self.said, self.unsaid) = (Some(host), (0, Duration::ZERO));
        let longest = longest.as_secs_f64();
        Some(format!(
            "this computer was late {times} times more, by {longest:.1} s at most: {}",
            busy()
        ))
    }
}

/// What keeps the processors, in words.
fn busy() -> String {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let load = std::fs::read_to_string("/proc/loadavg").ok();
    let load = load.as_deref().and_then(|words| words.split(' ').next());
    let load =
        load.map_or(String::new(), |load| format!(" (load {load}, processors {processors})"));
    format!("other work has its processors{load}")
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn a_thread_that_looks_ten_cycles_late_has_not_listened_since_its_last_look() {
        let start = Instant::now();
        let at = |t| start + ms(t);
        let mut attention = Attention::new(start);
        assert_eq!(attention.look(at(10), 1), None);
        assert_eq!(attention.look(at(110), 2), None);
        assert_eq!(attention.look(at(1310), 3), Some((Behind::Control, at(110))));
        assert_eq!(lateness(at(110), at(1310)), ms(1190));
    }

    #[test]
    fn a_network_thread_that_stands_is_noticed_beside_a_control_thread_that_runs() {
        let start = Instant::now();
        let at = |t| start + ms(t);
        let mut attention = Attention::new(start);
        attention.look(at(10), 1);
        let seen = (2..=12).find_map(|i| attention.look(at(10 * i), 1));
        assert_eq!(seen, Some((Behind::Network, at(10))));
        attention.resume(at(400), 3);
        assert_eq!(attention.look(at(410), 4), None);
    }

    #[test]
    fn a_thread_that_was_ready_to_run_was_kept_from_it_and_one_that_was_not_was_stopped() {
        let waited = |ms| Waited(Some(Duration::from_millis(ms)));
        assert_eq!(waited(100).cause(waited(800), ms(1000)), Cause::Busy);
        assert_eq!(waited(100).cause(waited(110), ms(1000)), Cause::Stopped);
        assert_eq!(Waited(None).cause(waited(110), ms(1000)), Cause::Unknown);
    }

    #[test]
    fn stalls_that_follow_each_other_make_two_lines_in_six_seconds() {
        let start = Instant::now();
        let at = |t| start + ms(t);
        let mut reports = Reports::default();
        let first = reports.note(at(0), ms(1200), Cause::Stopped).unwrap();
        assert!(
            first.starts_with("this computer was late by 1.2 s: the program was stopped"),
            "{first}"
        );
        let more: Vec<_> =
            (1..50).filter_map(|i| reports.note(at(100 * i), ms(100 + i), Cause::Busy)).collect();
        assert_eq!(more, [""; 0]);
        assert_eq!(reports.due(at(4900)), None);
        let rest = reports.due(at(5000)).unwrap();
        assert!(
            rest.starts_with("this computer was late 49 times more, by 0.1 s at most"),
            "{rest}"
        );
        assert_eq!(reports.due(at(20_000)), None);
    }
}
