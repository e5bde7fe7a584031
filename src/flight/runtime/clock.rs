//! Vehicle time, the time that the vehicle writes into its state frames. Between two frames it is extrapolated with the
//! monotonic clock of this computer, the host.

use std::time::{Duration, Instant};

use greylag_physics::Time;

/// How vehicle time advances between frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Real time: between frames, vehicle time advances with the host's clock while the link is polled.
    RealTime,
    /// Lockstep: vehicle time is constant between frames, until the vehicle has been silent for [`PATIENCE`]. The
    /// result of a flight therefore does not depend on the speed of the machine.
    Lockstep,
}

/// Silence after which a vehicle in lockstep counts as silent and no longer as busy with its computation. It exceeds the 1 s
/// after which the simulator repeats a frame that was not answered.
pub const PATIENCE: Duration = Duration::from_millis(1200);

/// Largest time that the interval between two polls of the link adds to the silence of the vehicle. In a longer interval the
/// companion has stalled and could not receive from the vehicle.
const LISTENED: Duration = Duration::from_millis(100);

/// Maps host time to vehicle time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    pace: Pace,
    /// Time of the newest state.
    anchor: Option<Time>,
    /// Silence of the vehicle since the newest state, as far as the link was polled, and the host time of the last poll.
    listened: (Duration, Option<Instant>),
}

impl Clock {
    pub(super) fn new(pace: Pace) -> Self {
        Clock { pace, anchor: None, listened: (Duration::ZERO, None) }
    }

    /// How vehicle time advances between frames.
    pub(super) fn pace(&self) -> Pace {
        self.pace
    }

    /// Records that a state with the vehicle time `time` arrived at the host time `arrived`.
    pub(super) fn set(&mut self, arrived: Instant, time: Time) {
        self.anchor = Some(time);
        self.listened = (Duration::ZERO, Some(arrived));
    }

    /// Records a poll of the link at the host time `host`.
    pub(super) fn listen(&mut self, host: Instant) {
        self.listened = (self.silence(host), Some(host));
    }

    /// Vehicle time at the host time `host`; zero before the first state.
    pub(super) fn at(&self, host: Instant) -> Time {
        let Some(time) = self.anchor else {
            return Time::default();
        };
        match self.pace {
            Pace::RealTime => time.plus(self.silence(host)),
            Pace::Lockstep => time.plus(self.silence(host).saturating_sub(PATIENCE)),
        }
    }

    /// Silence of the vehicle from the newest state to `host`, as far as the link was polled.
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
        // The link is polled for one second, then not polled for four seconds.
        for (pace, after_a_second, after_five) in
            [(Pace::RealTime, 6000, 6100), (Pace::Lockstep, 5000, 5000)]
        {
            let mut clock = Clock::new(pace);
            assert_eq!(clock.at(later(1)), time(0));
            clock.set(start, time(5000));
            (1..=100).for_each(|look| clock.listen(later(10 * look)));
            assert_eq!(clock.at(later(1000)), time(after_a_second));
            assert_eq!(clock.at(later(5000)), time(after_five));
        }
        let mut clock = Clock::new(Pace::Lockstep);
        clock.set(start, time(5000));
        for look in 1..=170 {
            clock.listen(later(10 * look));
        }
        // 1.7 s of silence are 0.5 s more than `PATIENCE`: vehicle time is 0.5 s after the newest state, and the pilot
        // counts the link as lost
        assert_eq!(clock.at(later(1700)), time(5500));
        // A stall of five seconds adds only `LISTENED` of silence.
        assert_eq!(clock.at(later(6700)), time(5600));
        clock.set(later(6700), time(5010));
        assert_eq!(clock.at(later(9000)), time(5010));
    }
}
