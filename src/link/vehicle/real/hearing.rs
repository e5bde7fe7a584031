//! Handles the frames that the companion (this program) receives from the flight controller. They identify the flight controller
//! and contain its mode and its state.

use std::time::Duration;

use super::engagement::Shown;
use super::profile::Stack;
use super::requests::{Answer, Requests};
use super::survey::Survey;
use super::{AUTOPILOT, Controller, GONE, ONBOARD, Real};
use crate::autopilot::Severity;
use crate::framing::{Frame, FrameCounts, Frames, Source};
use crate::peer::PeerId;
use crate::vehicle::{Notice, Telemetry};
use crate::wire::controller as wire;
use crate::wire::controller::ControllerMessage;

/// MAV_AUTOPILOT_INVALID: the sender is not a flight controller.
const NO_AUTOPILOT: u8 = 8;

impl Real {
    /// Handles the bytes `bytes` from `peer`, see [`crate::vehicle::Vehicle::handle`]. Passes each complete state to `deliver`.
    pub fn handle(
        &mut self,
        host: Duration,
        peer: PeerId,
        bytes: &[u8],
        mut deliver: impl FnMut(Telemetry),
    ) {
        let mut counts = FrameCounts::default();
        for frame in Frames::new(bytes, &mut counts) {
            if let Some(telemetry) = self.take(host, peer, &frame) {
                deliver(telemetry);
            }
        }
        self.counts.add(counts);
    }

    fn take(&mut self, host: Duration, peer: PeerId, frame: &Frame<'_>) -> Option<Telemetry> {
        let message = wire::read(frame);
        if let Some(ControllerMessage::Heartbeat { autopilot, armed, custom_mode }) = message {
            self.heartbeat_of(host, peer, frame.source, (autopilot, armed, custom_mode));
        }
        let ours = self.controller.is_some_and(|c| {
            c.peer == peer && frame.source == Source { system: c.system, component: AUTOPILOT }
        });
        if !ours {
            self.foreign += 1;
            return None;
        }
        self.survey.frame(host, frame.id, frame.sequence, frame.bytes.len());
        self.signs |= frame.signed;
        match message? {
            ControllerMessage::Ack { command: wire::SET_MODE, result, to } if self.is_us(to) => {
                self.engagement.answered(result);
            }
            ControllerMessage::Ack { command: wire::SET_MESSAGE_INTERVAL, result, to }
                if self.is_us(to) =>
            {
                if let Answer::Granted(id) = self.requests.answered(result) {
                    self.survey.restart(host, id);
                }
            }
            // while the companion has control, its own overrides may be reported as a radio-control receiver
            ControllerMessage::Receiver { alive } if !self.engagement.steers() => {
                self.radio = Some(alive);
            }
            ControllerMessage::CurrentMode { custom_mode } => self.shown(host, custom_mode),
            ControllerMessage::Parameter { name, cast, bytewise } => {
                let value = if self.profile.stack == Stack::Px4 { bytewise } else { cast };
                self.parameters.take(&name, value);
            }
            ControllerMessage::TimeSync { ours } => {
                let sent = u64::try_from(ours).ok().map(Duration::from_nanos);
                // a reply that is meant for another program contains a time of that program's clock
                let trip = sent.and_then(|sent| host.checked_sub(sent));
                if let Some(trip) = trip.filter(|trip| *trip <= GONE) {
                    self.survey.trip(trip);
                }
            }
            message => {
                let state = self.assembly.take(host, &message, &self.sent)?;
                self.last_state = Some(host);
                self.pulse.state();
                return Some(state);
            }
        }
        None
    }

    fn heartbeat_of(
        &mut self,
        host: Duration,
        peer: PeerId,
        from: Source,
        (autopilot, armed, custom_mode): (u8, bool, u32),
    ) {
        let known = self.controller.filter(|c| host.saturating_sub(c.heard) <= GONE);
        if from.component != AUTOPILOT || autopilot == NO_AUTOPILOT {
            let ourselves = known.is_some_and(|c| c.system == from.system);
            if from.component == ONBOARD && ourselves {
                self.intrude(from, "another onboard computer with our ids");
            } else if ourselves {
                self.sibling = Some((host, from));
            }
            return;
        }
        if known.is_some_and(|c| c.system != from.system || c.peer != peer) {
            self.intrude(from, "a second autopilot");
            return;
        }
        if known.is_none() {
            self.meet(from.system, autopilot);
        }
        let heard = host;
        let system = from.system;
        self.controller = Some(Controller { system, peer, autopilot, armed, heard });
        self.shown(host, custom_mode);
        if self.engagement.steers() && !armed {
            self.hand_back("the controller is disarmed".into());
        }
    }

    /// Handles the mode `custom_mode` that the controller reports. The mode shows whether the companion has control authority.
    fn shown(&mut self, host: Duration, custom_mode: u32) {
        let steered = self.profile.stack.steered(self.profile.authority);
        let name = steered.name;
        match self.engagement.shown(host, custom_mode == steered.custom(self.profile.stack)) {
            Shown::Nothing => {}
            Shown::Engaged => {
                self.say(Severity::Notice, format!("engaged: the controller is in {name}"));
                self.notices.push_back(Notice::Engaged);
            }
            Shown::Taken => self.notices.push_back(Notice::HandedBack(format!(
                "the controller left {name}: its own decision or its pilot's"
            ))),
            Shown::Confirmed => self.say(
                Severity::Notice,
                format!("handed back to the controller: it has left {name}, as it was asked"),
            ),
        }
    }

    /// Whether a reply to `to` is meant for this companion. Old firmware sets the target to zero.
    fn is_us(&self, to: Source) -> bool {
        let system = self.system().unwrap_or(0);
        matches!(to, Source { system: 0, component: 0 })
            || to == Source { system, component: ONBOARD }
    }

    /// Resets the link for a flight controller that appears for the first time or again. Its parameters and channel directions
    /// are then unknown. Until they have been read, the companion refuses to take control.
    fn meet(&mut self, system: u8, autopilot: u8) {
        if self.engagement.steers() {
            self.hand_back("no heartbeat of the controller for 3 s".into());
        }
        self.parameters.forget();
        self.survey = Survey::default();
        self.requests = Requests::default();
        (self.signs, self.radio, self.sibling) = (false, None, None);
        let stack = Stack::of(autopilot);
        let who = stack.map_or("an unknown autopilot".to_owned(), |stack| stack.to_string());
        self.say(Severity::Info, format!("controller found: {who}, system {system}"));
        self.notices.push_back(Notice::System(system));
        if stack != Some(self.profile.stack) {
            let words = self.wrong_stack(autopilot);
            self.say(Severity::Error, words);
        }
    }

    fn intrude(&mut self, from: Source, what: &str) {
        if !self.intruders.contains(&from) {
            self.intruders.push(from);
            let words = format!(
                "{what} (system {}, component {}) is on the vehicle's link: disconnect it or change its ids",
                from.system, from.component
            );
            self.say(Severity::Error, words);
        }
    }
}
