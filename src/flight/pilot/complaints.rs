//! Rate limit of warnings about persistent faults.

use super::Pilot;
use super::estimate::within;
use super::telemetry::LATE_AIR;
use greylag_link::autopilot::Severity;
use greylag_physics::Time;

/// Least time between two warnings of the same kind, s.
const COMPLAINT_INTERVAL_S: f64 = 5.0;

/// A warning is sent if airspeed and altitude are late by more than this, s. After a gap in telemetry they normally arrive
/// within 20 ms.
const LATE_AIR_S: f64 = 0.5;

/// Time of the last report of each kind. The end of the controller is reported once.
#[derive(Debug, Default)]
pub(super) struct Complaints {
    pub(super) defect: Option<Time>,
    pub(super) plan: Option<Time>,
    /// Whether the end of the controller was reported.
    pub(super) ended: bool,
    pub(super) fallback: Option<Time>,
    pub(super) limits: Option<Time>,
    pub(super) envelope: Option<Time>,
}

impl Pilot {
    pub(super) fn complain_of_state(&mut self, reason: &'static str) {
        if reason == LATE_AIR {
            let since = *self.air_late.get_or_insert(self.clock);
            if within(Some(since), self.clock, LATE_AIR_S) {
                return;
            }
        }
        if due(&mut self.complaints.defect, self.clock) {
            self.texts.say(Severity::Error, format!("vehicle state refused: {reason}"));
        }
    }

    /// Reports the measurements of angle of attack and airspeed that control no longer uses, or uses again.
    pub(super) fn report_air_data(&mut self) {
        for change in self.estimate.take_air_data_changes() {
            let severity = if change.is_refusal() { Severity::Error } else { Severity::Info };
            self.texts.say(severity, change.words());
        }
    }
}

/// Whether a warning that was last sent at `last` may be sent again at `now`. If so, sets `last` to `now`.
pub(super) fn due(last: &mut Option<Time>, now: Time) -> bool {
    let silent = within(*last, now, COMPLAINT_INTERVAL_S);
    if !silent {
        *last = Some(now);
    }
    !silent
}
