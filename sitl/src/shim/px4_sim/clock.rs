//! Assigns actuator messages to steps by the time stamps of the flight controller.

use super::{FIRST_US, STEP_US};

/// Relation of the controller's clock to simulated time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// No message has arrived yet.
    #[default]
    Unknown,
    /// The clock is behind simulated time by this offset, µs. The offset is 0, or the time of the first HIL_SENSOR that
    /// PX4 received, from which PX4 counts its time.
    Behind(u64),
    /// An unrelated clock; each message then counts as an answer to the latest step, as in Gazebo's plugin.
    Foreign,
}

/// Step that an actuator message answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answers {
    /// The latest step that was sent.
    Present,
    /// A step before the latest step.
    Past,
    /// No step that was sent.
    Nothing,
}

impl Clock {
    /// Finds the step that a message with the time stamp `time_us` answers. Steps were sent from `begun_us`, which is at least
    /// [`FIRST_US`], to `shown_us`; all times are in µs.
    ///
    /// Simulated time begins at [`FIRST_US`]. An offset of 0 and an offset of `begun_us` are therefore distinguishable
    /// while the message's time stamp is below [`FIRST_US`].
    pub fn judge(&mut self, time_us: u64, begun_us: u64, shown_us: u64) -> Answers {
        if *self == Clock::Unknown {
            *self = Clock::of(time_us, begun_us, shown_us);
        }
        let Clock::Behind(by_us) = *self else { return Answers::Present };
        let step_us = time_us.saturating_add(by_us);
        if step_us == shown_us {
            Answers::Present
        } else if (begun_us..shown_us).contains(&step_us) {
            Answers::Past
        } else {
            Answers::Nothing
        }
    }

    fn of(time_us: u64, begun_us: u64, shown_us: u64) -> Clock {
        if !time_us.is_multiple_of(STEP_US) {
            return Clock::Foreign;
        }
        match time_us {
            at if (begun_us..=shown_us).contains(&at) => Clock::Behind(0),
            since if since < FIRST_US && since <= shown_us - begun_us => Clock::Behind(begun_us),
            _ => Clock::Foreign,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn px4_counts_from_the_first_sensor_message() {
        let begun = FIRST_US + 40 * STEP_US;
        let (mut clock, shown) = (Clock::default(), begun + 10 * STEP_US);
        assert_eq!(clock.judge(9 * STEP_US, begun, shown), Answers::Past);
        assert_eq!(clock, Clock::Behind(begun));
        assert_eq!(clock.judge(10 * STEP_US, begun, shown), Answers::Present);
        assert_eq!(clock.judge(11 * STEP_US, begun, shown), Answers::Nothing);
        assert_eq!(clock.judge(u64::MAX, begun, shown), Answers::Nothing);
    }

    #[test]
    fn a_clock_that_echoes_and_one_that_is_foreign() {
        let (mut clock, shown) = (Clock::default(), FIRST_US + 10 * STEP_US);
        assert_eq!(clock.judge(shown, FIRST_US, shown), Answers::Present);
        assert_eq!(clock, Clock::Behind(0));
        assert_eq!(clock.judge(shown - STEP_US, FIRST_US, shown), Answers::Past);
        assert_eq!(clock.judge(7, FIRST_US, shown), Answers::Nothing);
        let mut foreign = Clock::default();
        assert_eq!(foreign.judge(1_763_000_000_123_457, FIRST_US, shown), Answers::Present);
        assert_eq!(foreign, Clock::Foreign);
    }
}
