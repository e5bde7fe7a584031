//! The pilot as clients see it, with an ear on the lines it says to them.

use super::Event;
use crate::flight::pilot::Pilot;
use crate::link::autopilot::{
    AttitudeSetpoint, Autopilot, Mode, Parameter, ParameterValue, Status, Sticks, Text, Verdict,
};
use crate::physics::Time;

/// Passes everything on to the pilot; each line for the ground stations becomes an event as well.
pub(super) struct Witness<'a, F: FnMut(Event)> {
    pub(super) pilot: &'a mut Pilot,
    pub(super) hear: F,
}

impl<F: FnMut(Event)> Autopilot for Witness<'_, F> {
    fn arm(&mut self, now: Time, force: bool) -> Verdict {
        self.pilot.arm(now, force)
    }
    fn disarm(&mut self, now: Time, force: bool) -> Verdict {
        self.pilot.disarm(now, force)
    }
    fn set_mode(&mut self, now: Time, mode: Mode) -> Verdict {
        self.pilot.set_mode(now, mode)
    }
    fn attitude_setpoint(&mut self, now: Time, setpoint: AttitudeSetpoint) {
        self.pilot.attitude_setpoint(now, setpoint);
    }
    fn sticks(&mut self, now: Time, sticks: Sticks) {
        self.pilot.sticks(now, sticks);
    }
    fn parameters(&self) -> &[Parameter] {
        self.pilot.parameters()
    }
    fn set_parameter(&mut self, index: usize, value: ParameterValue) -> Verdict {
        self.pilot.set_parameter(index, value)
    }
    fn status(&self) -> Status {
        self.pilot.status()
    }
    fn take_text(&mut self) -> Option<Text> {
        let text = self.pilot.take_text();
        if let Some(text) = &text {
            (self.hear)(Event::Text(text.clone()));
        }
        text
    }
}
