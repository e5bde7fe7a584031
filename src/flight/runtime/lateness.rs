//! Detection of stalls of the control thread and of the network thread, with their cause. Both threads run in rounds; in each
//! round they check for new packets (poll). A thread stalls if it does not poll for a long time.

use std::time::{Duration, Instant};

/// Time without a poll after which a thread counts as stalled: ten cycles of 10 ms.
const LATE: Duration = Duration::from_millis(100);
/// Longest regular interval between two polls: a thread polls at least once per cycle.
const USUAL: Duration = Duration::from_millis(10);
/// Shortest time between two stall reports.
const REPORT_INTERVAL: Duration = Duration::from_secs(5);
/// If the thread waited for a processor for at least this fraction of a stall, other load is the cause.
const BUSY: f64 = 0.5;

/// The thread that stalled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Behind {
    /// The control thread stalled, and probably the whole program.
    Control,
    /// Only the network thread stalled.
    Network,
}

/// Stall detector of the control and network threads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attention {
    /// Time of the control thread's last call of [`Attention::look`].
    looked: Instant,
    /// Number of the network thread's rounds, and the time at which an increase was last seen.
    network: (u64, Instant),
}

impl Attention {
    pub(super) fn new(host: Instant) -> Self {
        Attention { looked: host, network: (0, host) }
    }

    /// Checks both threads at the time `host`. The control thread calls it in every round. `rounds` is the number of the network
    /// thread's rounds so far. On a stall, returns the stalled thread and the time of its last poll.
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

    /// Restarts the detector after a stall. `host` is a time at which both threads poll again.
    pub(super) fn resume(&mut self, host: Instant, rounds: u64) {
        *self = Attention { looked: host, network: (rounds, host) };
    }
}

/// Length of the stall from the last poll at `since` to `host`, less the longest regular interval between two polls.
pub(super) fn lateness(since: Instant, host: Instant) -> Duration {
    host.saturating_duration_since(since).saturating_sub(USUAL)
}

/// Cause of a stall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cause {
    /// The thread could have run, but other work used the processor.
    Busy,
    /// The thread was stopped, or the machine was suspended.
    Stopped,
    /// The cause is unknown.
    Unknown,
}

/// Total time for which this thread has waited for a processor, from the scheduler's counters; `None` if unknown.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Waited(Option<Duration>);

impl Waited {
    /// The waiting time so far. It is unknown if the system has no such counters.
    pub(super) fn now() -> Self {
        let counted = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
        Waited(
            counted
                .and_then(|words| words.split(' ').nth(1)?.parse().ok())
                .map(Duration::from_nanos),
        )
    }

    /// Cause of a stall of length `missed`, from the waiting time before the stall (`self`) and after it (`now`).
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

/// Rate limit of stall reports. A first stall is reported immediately. The stalls of the next 5 s are reported together.
#[derive(Clone, Debug, Default)]
pub(super) struct Reports {
    /// Time of the last report.
    reported: Option<Instant>,
    /// Number of stalls that are not yet reported, and the length of the longest of them.
    unreported: (u32, Duration),
}

impl Reports {
    /// Notes a stall of length `missed` that ended at `host`. Returns its report; `None` if the last report is less than 5 s old.
    pub(super) fn note(&mut self, host: Instant, missed: Duration, cause: Cause) -> Option<String> {
        if self
            .reported
            .is_some_and(|reported| host.saturating_duration_since(reported) < REPORT_INTERVAL)
        {
            self.unreported = (self.unreported.0 + 1, self.unreported.1.max(missed));
            return None;
        }
        self.reported = Some(host);
        let late = format!("this computer stalled for {:.1} s", missed.as_secs_f64());
        Some(match cause {
            Cause::Busy => format!("{late}: {}", busy()),
            Cause::Stopped => format!("{late}: the program was stopped, or the machine suspended"),
            Cause::Unknown => late,
        })
    }

    /// The report due at `host` on the stalls not yet reported; `None` if no report is due.
    pub(super) fn due(&mut self, host: Instant) -> Option<String> {
        let (times, longest) = self.unreported;
        let waits = self
            .reported
            .is_none_or(|reported| host.saturating_duration_since(reported) < REPORT_INTERVAL);
        if times == 0 || waits {
            return None;
        }
        (self.reported, self.unreported) = (Some(host), (0, Duration::ZERO));
        let longest = longest.as_secs_f64();
        Some(format!(
            "this computer stalled {times} times more, for at most {longest:.1} s: {}",
            busy()
        ))
    }
}

/// Text that names other load on the processors as the cause, with the load average if the system gives one.
fn busy() -> String {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let load = std::fs::read_to_string("/proc/loadavg").ok();
    let load = load.as_deref().and_then(|words| words.split(' ').next());
    let load =
        load.map_or(String::new(), |load| format!(" (load {load}, processors {processors})"));
    format!("other load on its processors{load}")
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
            first.starts_with("this computer stalled for 1.2 s: the program was stopped"),
            "{first}"
        );
        let more: Vec<_> =
            (1..50).filter_map(|i| reports.note(at(100 * i), ms(100 + i), Cause::Busy)).collect();
        assert_eq!(more, [""; 0]);
        assert_eq!(reports.due(at(4900)), None);
        let rest = reports.due(at(5000)).unwrap();
        assert!(
            rest.starts_with("this computer stalled 49 times more, for at most 0.1 s"),
            "{rest}"
        );
        assert_eq!(reports.due(at(20_000)), None);
    }
}
