//! Failsafes of the pilot, the part of the companion that decides on each command. They act on the loss and the recovery of the
//! link to the vehicle, and on a restart of the vehicle. They also act on the loss of the setpoints or stick inputs of a client
//! (a ground station or an offboard program).

use std::time::Duration;

use super::estimate::{Estimate, Frame, within};
use super::oscillation::Oscillation;
use super::{Complaints, Pilot};
use greylag_link::autopilot::{Mode, Severity};
use greylag_physics::Time;

/// Largest change of a command, as a fraction of full deflection, after which the measured state may still be constant. A larger
/// change must appear in the body rates: an aileron change of 0.005 rolls the X8 at 0.85 °/s (Clδa δa / |Clp| · 2V/b), which is
/// above the resolution of any gyro.
const UNFELT_TRAVEL: f64 = 0.005;

/// Time (s) for which the measured state may be constant although the commands change. Then the link counts as lost, because
/// consecutive values of real sensors are not equal bit by bit. An aircraft with a roll rate of 100 °/s rolls by 20° in this
/// time.
const FROZEN_LOSS_S: f64 = 0.2;

/// Time (s) for which the link to the vehicle must have been back before its recovery is reported. It equals the default
/// time after which the link counts as lost.
const STEADY_S: f64 = 0.5;

impl Pilot {
    /// Counts a frame that repeats the previous state bit by bit as fresh while the aircraft is disarmed or no command changes.
    /// The vehicle may then wait for its launch, or a simulation without noise may have settled.
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

    /// Whether a fresh state has arrived within the timeout of the vehicle link; `None` before the first fresh state.
    pub(super) fn state_fresh(&self) -> Option<bool> {
        let limit = match self.estimate.is_frozen() {
            true => self.config.vehicle_loss_s.min(FROZEN_LOSS_S),
            false => self.config.vehicle_loss_s,
        };
        self.estimate.fresh_within(self.clock, limit)
    }

    /// Excludes a stall of this computer of length `missed` from the ages of state, setpoints and sticks. A stall therefore
    /// does not count as a loss of the link or of a client.
    pub fn excuse(&mut self, missed: Duration) {
        self.estimate.excuse(missed);
        let later = |at: &mut Time| *at = at.plus(missed);
        self.setpoint.iter_mut().for_each(|(at, _)| later(at));
        self.sticks.iter_mut().for_each(|(at, _)| later(at));
        self.vehicle_back.iter_mut().for_each(later);
    }

    /// Detects the loss of the link to the vehicle, and reports its recovery once this has lasted. An intermittent link is
    /// therefore reported as one loss.
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

    /// Resets the pilot after the vehicle's clock has jumped back, because earlier states and times are no longer valid.
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
