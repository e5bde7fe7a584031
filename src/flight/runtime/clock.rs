//! Vehicle time between two state frames, by the host's monotonic clock.

use std::time::{Duration, Instant};

use greylag_physics::Time;

/// How the vehicle's time passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// As on the wall: between frames it goes on with the host's clock.
    RealTime,
    /// In steps of the answers: it stands between frames, until the vehicle has been silent for
    /// [`PATIENCE`]. So a flight does not depend on the speed of the machine.
    Lockstep,
}

/// Silence after which a vehicle in lockstep is no longer taken to be computing: the shim repeats
/// an unanswered frame after one second.
pub const PATIENCE: Duration = Duration::from_millis(1200);

/// Most of a silence that counts between two looks at the link: a companion that was held up itself has not
/// listened meanwhile.
const LISTENED: Duration = Duration::from_millis(100);

/// Maps the host's clock to the vehicle's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    pace: Pace,
    anchor: Option<(Instant, Time)>,
    /// Silence since the anchor that was listened to, and until when.
    listened: (Duration, Option<Instant>),
}

impl Clock {
    pub(super) fn new(pace: Pace) -> Self {
        Clock { pace, anchor: None, listened: (Duration::ZERO, None) }
    }

    /// How the vehicle's time passes.
    pub(super) fn pace(&self) -> Pace {
        self.pace
    }

    /// A state of vehicle time `time` arrived at `arrived`.
    pub(super) fn set(&mut self, arrived: Instant, time: Time) {
        self.anchor = Some((arrived, time));
        self.listened = (Duration::ZERO, Some(arrived));
    }

    /// The link is looked at, at `host`.
    pub(super) fn listen(&mut self, host: Instant) {
        self.listened = (self.silence(host), Some(host));
    }

    /// Vehicle time at `host`; zero before the first state.
    pub(super) fn at(&self, host: Instant) -> Time {
        let Some((arrived, time)) = self.anchor else {
            return Time::default();
        };
        match self.pace {
            Pace::RealTime => time.plus(host.saturating_duration_since(arrived)),
            Pace::Lockstep => time.plus(self.silence(host).saturating_sub(PATIENCE)),
        }
    }

    /// How long the vehicle has been silent at `host` while somebody listened.
    fn silence(&self, host: Instant) -> Duration {
        let (silence, until) = self.listened;
        let since = until.map_or(Duration::ZERO, |until| host.saturating_duration_since(until));
        silence + since.min(LISTENED)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vehicle_time_goes_on_with_the_host_or_stands_in_lockstep() {
        let start = Instant::now();
        let time = |ms: u64| Time::from_micros(1000 * ms);
        let later = |ms: u64| start + Duration::from_millis(ms);
        for (pace, after_a_second) in [(Pace::RealTime, 6000), (Pace::Lockstep, 5000)] {
            let mut clock = Clock::new(pace);
            assert_eq!(clock.at(later(1)), time(0));
            clock.set(start, time(5000));
            assert_eq!(clock.at(later(1000)), time(after_a_second));
        }
        let mut clock = Clock::new(Pace::Lockstep);
        clock.set(start, time(5000));
        for look in 1..=170 {
            clock.listen(later(10 * look));
        }
        // Half a second beyond the patience the pilot finds the link lost.
        assert_eq!(clock.at(later(1700)), time(5500));
        // A companion that stood still for five seconds has not heard five seconds of silence.
        assert_eq!(clock.at(later(6700)), time(5600));
        clock.set(later(6700), time(5010));
        assert_eq!(clock.at(later(9000)), time(5010));
    }
}
