//! What is wished for: the target of the schedule, of the mode, or level.

use super::{Pilot, ThrustSource};
use greylag_control::Target;
use greylag_link::autopilot::Mode;
use greylag_physics::Time;

impl Pilot {
    /// The target of the schedule, if one is flown at `now`.
    pub(super) fn scheduled_wish(&mut self, now: Time) -> Option<(Target, Option<f64>)> {
        let programme = self.programme.as_mut()?;
        if self.mode == Mode::Offboard && self.setpoint.is_some() {
            return Some((programme.wish(now, &mut self.texts), None));
        }
        programme.stop();
        None
    }

    /// The target of the mode, before the envelope, with the throttle if the mode sets it itself.
    pub(super) fn wish(&self) -> (Target, Option<f64>) {
        let airspeed = self.config.envelope.airspeed_cruise_mps;
        match (self.mode, self.setpoint, self.sticks) {
            (Mode::Offboard, Some((_, s)), _) => {
                let throttle =
                    s.thrust.filter(|_| self.config.thrust_source == ThrustSource::Setpoint);
                (Target { roll: s.roll, pitch: s.pitch, airspeed }, throttle)
            }
            (Mode::Stabilized, _, Some((_, s))) => {
                // A stick forward is nose down; each half of its travel reaches its own limit.
                let pitch = if s.pitch > 0.0 {
                    s.pitch * self.limits.pitch_min
                } else {
                    -s.pitch * self.limits.pitch_max
                };
                (Target { roll: s.roll * self.limits.bank_max, pitch, airspeed }, Some(s.throttle))
            }
            _ => (self.level_target(), None),
        }
    }

    pub(super) fn level_target(&self) -> Target {
        let airspeed = self.config.envelope.airspeed_cruise_mps;
        Target { roll: 0.0, pitch: self.config.trim_at(airspeed).pitch_deg.to_radians(), airspeed }
    }
}
