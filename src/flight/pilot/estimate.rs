//! The newest usable state of the vehicle, and its age. A state is fresh if it differs from the state before it. "Vehicle
//! time" is the time by the vehicle's clock.

use std::time::Duration;

use super::air_data::{AirDataCheck, Change};
use super::config::Config;
use super::lift::CORRECTED_SD;
use super::side_force::BySideForce;
use super::telemetry::{defect, repeats};
use greylag_link::vehicle::{Telemetry, VANE_SD};
use greylag_physics::{State, Time};

/// Largest step back of vehicle time that does not count as a restart of the vehicle. Reordered frames step back by one
/// or two cycles only.
pub(super) const RESTART: Duration = Duration::from_secs(1);

/// Usability of a telemetry frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Frame {
    /// A new, usable state.
    Usable,
    /// A state equal bit by bit to the previous state. It is usable for a short time, but not fresh.
    Frozen,
    /// A repeated or reordered frame, whose time is not after that of the newest frame. A command for the newest frame
    /// was already decided.
    Repeated,
    /// The state is unusable, for this reason.
    Defective(&'static str),
}

/// The newest usable frame with its arrival time in vehicle time.
#[derive(Debug, Default)]
pub(super) struct Estimate {
    last: Option<Telemetry>,
    newest: Option<Time>,
    usable_at: Option<Time>,
    fresh_at: Option<Time>,
    frozen: bool,
    air_data: AirDataCheck,
    by_side_force: BySideForce,
    /// Angle of attack (rad), airspeed (m/s) and sideslip (rad) for control in `last`.
    air: [f64; 3],
}

impl Estimate {
    /// Registers a frame that arrived at `now`, and returns its usability. `config` has the lift and the side force of the model.
    pub(super) fn take(&mut self, now: Time, frame: &Telemetry, config: &Config) -> Frame {
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
        let [alpha, airspeed] = self.air_data.for_control(config.lift.as_ref(), frame);
        let pressure_airspeed = self.air_data.last_airspeed();
        let beta =
            self.by_side_force.sideslip(config.side_force.as_ref(), frame, pressure_airspeed);
        self.air = [alpha, airspeed, beta];
        self.usable_at = Some(now);
        if frozen {
            return Frame::Frozen;
        }
        self.fresh_at = Some(now);
        Frame::Usable
    }

    /// Whether `frame` is older than the newest frame by more than 1 s, which reordering cannot explain.
    pub(super) fn restarted(&self, frame: &Telemetry) -> bool {
        self.newest.is_some_and(|newest| newest.since(frame.time) > RESTART)
    }

    /// Counts an unchanged state as fresh at `now`. The caller knows a reason why the state is constant.
    pub(super) fn refresh(&mut self, now: Time) {
        if self.usable_at.is_some() {
            self.fresh_at = Some(now);
        }
    }

    /// Excludes `missed`, the length of a stall of this computer, from the age of the state.
    pub(super) fn excuse(&mut self, missed: Duration) {
        for at in [&mut self.usable_at, &mut self.fresh_at].into_iter().flatten() {
            *at = at.plus(missed);
        }
    }

    /// Whether the last usable frame equals the frame before it.
    pub(super) fn is_frozen(&self) -> bool {
        self.frozen
    }

    pub(super) fn last(&self) -> Option<&Telemetry> {
        self.last.as_ref()
    }

    /// The last frame, with angle of attack and airspeed ([`AirDataCheck`]) and sideslip ([`BySideForce`]) for control. Their
    /// standard deviations are zero where a vane measures them.
    pub(super) fn for_control(&self) -> Option<Telemetry> {
        let [alpha, airspeed, beta] = self.air;
        self.last.map(|last| Telemetry {
            state: State { alpha, airspeed, beta, ..last.state },
            incidence_sd: std::array::from_fn(|k| match last.incidence_sd[k] {
                sd if sd > VANE_SD[k] => sd.min(CORRECTED_SD[k]),
                _ => 0.0,
            }),
            ..last
        })
    }

    /// Takes the changes in the use of measured air data since the last call.
    pub(super) fn take_air_data_changes(&mut self) -> Vec<Change> {
        self.air_data.take_changes()
    }

    /// Whether a usable state arrived within `limit_s` before `now`.
    pub(super) fn usable_within(&self, now: Time, limit_s: f64) -> bool {
        within(self.usable_at, now, limit_s)
    }

    /// Whether a fresh state arrived within `limit_s` before `now`; `None` before the first fresh state.
    pub(super) fn fresh_within(&self, now: Time, limit_s: f64) -> Option<bool> {
        self.fresh_at.map(|_| within(self.fresh_at, now, limit_s))
    }
}

/// Whether `then` lies at most `limit_s` before `now`.
pub(super) fn within(then: Option<Time>, now: Time, limit_s: f64) -> bool {
    // a tolerance of half a microsecond, so that a time exactly at the limit still counts
    then.is_some_and(|then| now.since(then).as_secs_f64() <= limit_s + 5e-7)
}
