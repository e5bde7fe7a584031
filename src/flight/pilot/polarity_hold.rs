//! The pilot during the polarity check, from arming to the verdict.
//!
//! The check gives pulses to aileron and elevator and tests whether the aircraft responds in the direction that the model
//! predicts.

use super::estimate::Frame;
use super::polarity::Verdict;
use super::{Pending, Pilot};
use greylag_link::autopilot::Severity;
use greylag_physics::{Command, Time};

impl Pilot {
    /// Passes the state to the polarity check. Returns the action of this tick while the check runs and after it has found a
    /// fault; otherwise `None`.
    pub(super) fn check_polarity(&mut self, quality: Frame) -> Option<Pending> {
        if self.refused.is_none() && !self.check.as_ref()?.is_open() {
            return None;
        }
        let usable = matches!(quality, Frame::Usable | Frame::Frozen) && !self.vehicle_lost;
        let Some(frame) = self.estimate.last().copied().filter(|_| usable) else {
            return Some(Pending::Unusable);
        };
        let airspeed = frame.state.airspeed.max(0.0);
        let level = self.level_at(airspeed);
        let check = self.check.as_mut()?;
        if check.is_open() {
            match check.see(frame.time, &frame.state, level) {
                Verdict::Open => {}
                Verdict::Right([roll, pitch]) => self.texts.say(
                    Severity::Info,
                    format!(
                        "signs are right: {roll:.1} and {pitch:.1} of the model's roll and pitch"
                    ),
                ),
                Verdict::Wrong(fault) => self.refused = Some(fault),
            }
        }
        let open = self.refused.is_some() || self.check.as_ref()?.is_open();
        open.then_some(Pending::Check { time: frame.time, airspeed })
    }

    /// The command during the check: trim of straight flight, with pulses once the companion has control authority.
    pub(super) fn check_command(&self, time: Time, airspeed: f64) -> Command {
        let pulsed = self.check.as_ref().and_then(|check| check.command(time));
        pulsed.unwrap_or_else(|| self.level_at(airspeed))
    }

    /// Command for straight flight with level wings at an airspeed, m/s. The throttle is full below the envelope's smallest
    /// airspeed and idle above its largest.
    fn level_at(&self, airspeed: f64) -> Command {
        let trim = self.config.trim_at(airspeed);
        let throttle = self.limits.protect(trim.throttle, airspeed);
        Command { elevator: trim.elevator, throttle, ..Command::IDLE }
    }
}
