//! The pilot's interface for clients (ground stations and offboard programs). It records the calls that change the pilot's state
//! and reports each text as an event.

use super::Event;
use crate::pilot::Pilot;
use crate::recorder::{Call, Recorder};
use greylag_link::autopilot::{
    AttitudeSetpoint, Autopilot, Mode, Parameter, ParameterValue, Status, Sticks, Text, Verdict,
};
use greylag_link::vehicle::Vehicle;
use greylag_physics::Time;

/// Passes calls to the pilot. If control of the vehicle cannot be taken now, arming is refused without a call of the pilot.
/// Each text for the ground stations also becomes an event.
pub(super) struct RecordingAutopilot<'a, F: FnMut(Event)> {
    pub(super) pilot: &'a mut Pilot,
    pub(super) vehicle: &'a Vehicle,
    pub(super) recorder: Option<&'a Recorder>,
    pub(super) hear: F,
}

impl<F: FnMut(Event)> RecordingAutopilot<'_, F> {
    fn note(&self, call: Call) {
        if let Some(recorder) = self.recorder {
            recorder.call(call);
        }
    }
}

impl<F: FnMut(Event)> Autopilot for RecordingAutopilot<'_, F> {
    fn arm(&mut self, now: Time, force: bool) -> Verdict {
        // force skips the pilot's own checks, but arming still needs a vehicle that can be controlled
        match self.vehicle.obstacle() {
            Some(obstacle) => Verdict::Rejected(format!("arming refused: {obstacle}")),
            None => {
                self.note(Call::Arm(now, force));
                self.pilot.arm(now, force)
            }
        }
    }
    fn disarm(&mut self, now: Time, force: bool) -> Verdict {
        self.note(Call::Disarm(now, force));
        self.pilot.disarm(now, force)
    }
    fn set_mode(&mut self, now: Time, mode: Mode) -> Verdict {
        self.note(Call::Mode(now, mode));
        self.pilot.set_mode(now, mode)
    }
    fn attitude_setpoint(&mut self, now: Time, setpoint: AttitudeSetpoint) {
        self.note(Call::Setpoint(now, setpoint));
        self.pilot.attitude_setpoint(now, setpoint);
    }
    fn sticks(&mut self, now: Time, sticks: Sticks) {
        self.note(Call::Sticks(now, sticks));
        self.pilot.sticks(now, sticks);
    }
    fn parameters(&self) -> &[Parameter] {
        self.pilot.parameters()
    }
    fn set_parameter(&mut self, index: usize, value: ParameterValue) -> Verdict {
        self.note(Call::Parameter(index, value));
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
