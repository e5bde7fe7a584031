//! The estimate: the newest state that can be believed, with its age.

use std::time::Duration;

use super::telemetry::{defect, repeats};
use greylag_link::vehicle::Telemetry;
use greylag_physics::Time;

/// How far vehicle time may run backwards before the vehicle counts as restarted. Frames that
/// overtake one another do so by one or two cycles.
pub(super) const RESTART: Duration = Duration::from_secs(1);

/// What a frame is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Frame {
    /// A new state.
    Usable,
    /// A state, equal to the bit to the one before: usable for a while, but not fresh.
    Frozen,
    /// Not newer than the last frame: its command has been decided already.
    Repeated,
    /// Its numbers cannot be flown on, with the reason.
    Defective(&'static str),
}

/// The newest believable frame, with when it came (pilot's clock).
#[derive(Debug, Default)]
pub(super) struct Estimate {
    last: Option<Telemetry>,
    newest: Option<Time>,
    usable_at: Option<Time>,
    fresh_at: Option<Time>,
    frozen: bool,
}

impl Estimate {
    /// Takes a frame in at `now`.
    pub(super) fn take(&mut self, now: Time, frame: &Telemetry) -> Frame {
        if self.newest.is_some_and(|newest| frame.time <= newest) {
            return Frame::Repeated;
        }
        self.newest = Some(frame.time);
        if let Some(reason) = defect(frame) {
            return Frame::Defective(reason);
        }
        let frozen = self.last.is_some_and(|last| repeats(frame, &last));
        self.frozen = frozen;
        self.last = Some(*frame);
        self.usable_at = Some(now);
        if frozen {
            return Frame::Frozen;
        }
        self.fresh_at = Some(now);
        Frame::Usable
    }

    /// Whether `frame` comes from before the vehicle's newest by more than reordering explains.
    pub(super) fn restarted(&self, frame: &Telemetry) -> bool {
        self.newest.is_some_and(|newest| newest.since(frame.time) > RESTART)
    }

    /// Counts the state as fresh from `now`, as when it has been standing still with a reason.
    pub(super) fn refresh(&mut self, now: Time) {
        if self.usable_at.is_some() {
            self.fresh_at = Some(now);
        }
    }

    /// Whether the last believable frame was equal to the one before.
    pub(super) fn is_frozen(&self) -> bool {
        self.frozen
    }

    pub(super) fn last(&self) -> Option<&Telemetry> {
        self.last.as_ref()
    }

    /// Whether a usable state came within `limit_s` before `now`.
    pub(super) fn usable_within(&self, now: Time, limit_s: f64) -> bool {
        within(self.usable_at, now, limit_s)
    }

    /// Whether a fresh state came within `limit_s` before `now`; `None` if there never was one.
    pub(super) fn fresh_within(&self, now: Time, limit_s: f64) -> Option<bool> {
        self.fresh_at.map(|_| within(self.fresh_at, now, limit_s))
    }
}

/// Whether `then` lies at most `limit_s` before `now`.
pub(super) fn within(then: Option<Time>, now: Time, limit_s: f64) -> bool {
    // Half a microsecond of tolerance: the limit itself is on the good side.
    then.is_some_and(|then| now.since(then).as_secs_f64() <= limit_s + 5e-7)
}
