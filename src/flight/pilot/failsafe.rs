//! What is lost, what comes back: the vehicle, the setpoints, the sticks, the vehicle's clock.

use super::estimate::{Estimate, Frame};
use super::oscillation::Oscillation;
use super::{Complaints, Pilot};
use greylag_link::autopilot::{Mode, Severity};
use greylag_physics::Time;

/// Change of a command that a flying aircraft shows within a fifth of a second, in units of 0..1:
/// 0.005 of aileron rolls the X8 at 0.85 °/s (Clδa δa / Clp · 2V/b), which no sensor misses.
const UNFELT_TRAVEL: f64 = 0.005;

/// Sensors that stand still under commands that move are lost after this time, s: an aircraft that
/// rolls as fast as it may rolls on by 20° meanwhile, and real sensors do not repeat to the bit.
const FROZEN_LOSS_S: f64 = 0.2;

impl Pilot {
    /// A state that stands still while nothing asks it to move is no fault: the vehicle waits for
    /// its launch, or a simulator without noise has settled.
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

    /// Whether the state is fresh; `None` if there never was one.
    pub(super) fn state_fresh(&self) -> Option<bool> {
        let limit = match self.estimate.is_frozen() {
            true => self.config.vehicle_loss_s.min(FROZEN_LOSS_S),
            false => self.config.vehicle_loss_s,
        };
        self.estimate.fresh_within(self.clock, limit)
    }

    pub(super) fn watch_vehicle(&mut self) {
        let fresh = self.state_fresh();
        if fresh != Some(false) || self.vehicle_lost {
            return;
        }
        self.vehicle_lost = true;
        if self.armed {
            self.texts.say(Severity::Critical, "vehicle link lost: level, HOLD");
            self.mode = Mode::Hold;
        } else {
            self.texts.say(Severity::Warning, "vehicle link lost");
        }
    }

    pub(super) fn watch_return(&mut self) {
        if self.vehicle_lost && self.state_fresh() == Some(true) {
            self.vehicle_lost = false;
            let words =
                if self.armed { "vehicle link back: flying in HOLD" } else { "vehicle link back" };
            self.texts.say(Severity::Notice, words);
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

    /// The vehicle's clock has started again: all that was known is of another life.
    pub(super) fn restart(&mut self) {
        if self.estimate.last().is_some() {
            self.texts.say(Severity::Warning, "vehicle clock went back: vehicle restarted?");
        }
        self.estimate = Estimate::default();
        self.setpoint = None;
        self.sticks = None;
        self.vehicle_lost = false;
        self.complaints = Complaints::default();
        self.oscillation = Oscillation::default();
        self.eased = None;
        self.upset = false;
        self.forget_controllers();
    }
}
