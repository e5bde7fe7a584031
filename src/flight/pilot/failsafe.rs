//! Detects loss and recovery of the vehicle link, loss of setpoints and sticks, and restarts of the vehicle's clock.

use std::time::Duration;

use super::estimate::{Estimate, Frame, within};
use super::oscillation::Oscillation;
use super::{Complaints, Pilot};
use greylag_link::autopilot::{Mode, Severity};
use greylag_physics::Time;

/// Largest change of a command that may leave the state unchanged, as a fraction of full deflection. A larger change
/// must be visible in the rates: an aileron change of 0.005 rolls the X8 at 0.85 °/s (Clδa δa / Clp · 2V/b), above the
/// resolution of any gyro.
const UNFELT_TRAVEL: f64 = 0.005;

/// Time after which constant sensor values under changing commands count as frozen, s. In this time an aircraft at its
/// largest roll rate rolls by 20°. Real sensors do not repeat bit by bit.
const FROZEN_LOSS_S: f64 = 0.2;

/// Time for which a recovered vehicle link must persist before the recovery is reported, s. It equals the default
/// timeout of the vehicle link.
const STEADY_S: f64 = 0.5;

impl Pilot {
    /// Accepts constant sensor values while no command changes. The vehicle may wait for its launch, or a simulator
    /// without noise may have settled.
    pub(super) fn excuse_stillness(&mut self, quality: Frame, now: Time) {
        let (was, is) = (self.last_moved, self.in_force);
        let moves =
            [is.aileron - was.aileron, is.elevator - was.elevator, is.throttle - was.throttle];
        if quality == Frame::Usable {
            self.last_moved = self.in_force;
        } else if quality == Frame::Frozen
            && (!self.armed || moves.iter().all(|m| m.abs() <= UNFELT_TRAVEL))
        {
            self.estimate.refresh(now);
        }
    }

    /// Whether the state is fresh; `None` before the first fresh state.
    pub(super) fn state_fresh(&self) -> Option<bool> {
        let limit = match self.estimate.is_frozen() {
            true => self.config.vehicle_loss_s.min(FROZEN_LOSS_S),
            false => self.config.vehicle_loss_s,
        };
        self.estimate.fresh_within(self.clock, limit)
    }

    /// Excludes `missed`, the length of a stall of this computer, from the ages of state, setpoints and sticks. The
    /// next state is treated as if there had been no stall.
    pub fn excuse(&mut self, missed: Duration) {
        self.estimate.excuse(missed);
        let later = |at: &mut Time| *at = at.plus(missed);
        self.setpoint.iter_mut().for_each(|(at, _)| later(at));
        self.sticks.iter_mut().for_each(|(at, _)| later(at));
        self.vehicle_back.iter_mut().for_each(later);
    }

    /// Detects the loss of the vehicle, and reports the recovery once it has persisted. An intermittent link counts as
    /// one loss.
    pub(super) fn watch_vehicle(&mut self) {
        if self.state_fresh() == Some(false) && !self.vehicle_lost {
            self.lose_vehicle();
        }
        if self.loss_reported
            && !self.vehicle_lost
            && !within(self.vehicle_back, self.clock, STEADY_S)
        {
            self.loss_reported = false;
            let words = match self.armed && self.mode == Mode::Hold {
                true => "vehicle link back: flying in HOLD",
                false => "vehicle link back",
            };
            self.texts.say(Severity::Notice, words);
        }
    }

    fn lose_vehicle(&mut self) {
        self.vehicle_lost = true;
        let news = !self.loss_reported || (self.armed && self.mode != Mode::Hold);
        self.loss_reported = true;
        if self.armed {
            self.mode = Mode::Hold;
        }
        match (news, self.armed) {
            (true, true) => self.texts.say(Severity::Critical, "vehicle link lost: level, HOLD"),
            (true, false) => self.texts.say(Severity::Warning, "vehicle link lost"),
            (false, _) => {}
        }
    }

    pub(super) fn watch_return(&mut self) {
        if self.vehicle_lost && self.state_fresh() == Some(true) {
            self.vehicle_lost = false;
            self.vehicle_back = Some(self.clock);
        }
    }

    pub(super) fn watch_client(&mut self) {
        let (lost, what) = match self.mode {
            Mode::Offboard => (!self.setpoint_fresh(), "setpoints"),
            Mode::Manual | Mode::Stabilized => (self.armed && !self.sticks_fresh(), "sticks"),
            Mode::Hold | Mode::Return => return,
        };
        if lost {
            let words = format!("{} lost for {:.1} s: HOLD", what, self.config.offboard_loss_s);
            self.texts.say(Severity::Critical, words);
            self.mode = Mode::Hold;
            self.setpoint_lost = true;
        }
    }

    /// Resets the pilot after a restart of the vehicle's clock, because earlier states and times are invalid.
    pub(super) fn restart(&mut self) {
        if self.estimate.last().is_some() {
            self.texts.say(Severity::Warning, "vehicle clock jumped back: vehicle restarted?");
        }
        self.estimate = Estimate::default();
        self.setpoint = None;
        self.sticks = None;
        self.vehicle_lost = false;
        (self.loss_reported, self.vehicle_back, self.air_late) = (false, None, None);
        self.complaints = Complaints::default();
        self.oscillation = Oscillation::default();
        self.oscillated = None;
        self.upset = false;
        self.forget_controllers();
    }
}
