//! Conditions that prevent the companion from taking control of a flight controller, as texts with their remedies.

use super::profile::{Authority, Stack};
use super::{ENOUGH, GONE, Real};
use crate::framing::Source;

/// Text for a flight controller that signs its frames and ignores unsigned ones, while this companion does not sign.
const SHUT_OUT: &str = "the controller signs its frames and ignores ours, which carry no right \
                        signature: give its key with --sign and add --sign-vehicle";

impl Real {
    /// Warning for ArduPilot with a bound RC transmitter, if surfaces are commanded; `None` in all other cases. If the companion
    /// fails, its overrides of the transmitter end, and ArduPlane flies on the transmitter's sticks in MANUAL. It leaves
    /// MANUAL only by its ground-station failsafe, for which the companion is the ground station.
    pub fn radio_warning(&self) -> Option<String> {
        let by_channels =
            (self.profile.stack, self.profile.authority) == (Stack::Ardupilot, Authority::Surfaces);
        (by_channels && self.radio == Some(true)).then(|| {
            let patience = self.parameters.get("FS_LONG_TIMEOUT");
            let patience = patience.map_or("FS_LONG_TIMEOUT".into(), |s| format!("{s} s"));
            format!(
                "a radio is bound: if this computer dies, ArduPilot flies on the radio's sticks in MANUAL for {patience}, \
                 then returns. Put its throttle at cruise and be ready to fly"
            )
        })
    }

    /// Whether the flight controller signs its frames and has not replied to any parameter request.
    pub fn is_shut_out(&self) -> bool {
        self.signs && self.parameters.is_silent()
    }

    /// Reason for which the flight controller refused to send the message `id` periodically, with the remedy; `None` if it did
    /// not refuse.
    pub fn denial(&self, id: u32) -> Option<String> {
        self.requests.words(self.profile.stack).filter(|_| self.requests.is_denied(id))
    }

    /// Reason for which the companion cannot take control now, with the remedy; `None` if it can.
    pub fn obstacle(&self) -> Option<String> {
        let Some(controller) = self.controller else {
            return Some(
                "no flight controller heard: check port, baud rate and its MAVLink".into(),
            );
        };
        if Stack::of(controller.autopilot) != Some(self.profile.stack) {
            return Some(self.wrong_stack(controller.autopilot));
        }
        if let Some(Source { system, component }) = self.intruders.last() {
            return Some(format!(
                "system {system}, component {component} is on the vehicle's link too: \
                 disconnect it, then start again"
            ));
        }
        if !controller.armed {
            return Some("the controller is not armed: arm and launch it first".into());
        }
        if self.is_shut_out() {
            return Some(SHUT_OUT.into());
        }
        let radio = self.radio == Some(true);
        let parameters = self.parameters.obstacle(controller.system, radio);
        parameters
            .or_else(|| self.hidden_death())
            .or_else(|| self.delay_obstacle())
            .or_else(|| self.thin_stream())
    }

    /// Reason for which the companion cannot take control while another component with the aircraft's system id sends
    /// heartbeats; `None` without such a component. It applies to ArduPilot with a bound transmitter and commanded surfaces.
    ///
    /// ArduPlane identifies its ground station by the system id alone, and the companion uses the aircraft's system id. If the
    /// companion failed, the other component's heartbeats would prevent the ground-station failsafe. The aircraft would stay
    /// on the transmitter's sticks.
    fn hidden_death(&self) -> Option<String> {
        let by_channels =
            (self.profile.stack, self.profile.authority) == (Stack::Ardupilot, Authority::Surfaces);
        let (_, from) = self.sibling.filter(|(heard, _)| {
            by_channels && self.radio == Some(true) && self.now.saturating_sub(*heard) <= GONE
        })?;
        Some(format!(
            "component {} of system {} sends heartbeats too, which ArduPilot takes for ours: with a radio bound they would hide \
             that this computer is dead. Give it another system id, or fly with --command attitude",
            from.component, from.system
        ))
    }

    /// Text about a required periodic message whose rate is too low; `None` if all rates suffice.
    fn thin_stream(&self) -> Option<String> {
        let thin = self
            .profile
            .stack
            .streams()
            .iter()
            .find(|stream| stream.needed && self.survey.hz(stream.id) < ENOUGH * stream.hz)?;
        if let Some(words) = self.denial(thin.id) {
            return Some(words);
        }
        Some(format!(
            "{} comes at {:.0} Hz, {:.0} are needed: wait a second, then see `greylag link check`",
            thin.name,
            self.survey.hz(thin.id),
            thin.hz
        ))
    }

    pub(super) fn wrong_stack(&self, autopilot: u8) -> String {
        match Stack::of(autopilot) {
            Some(Stack::Px4) => "the controller is PX4: fly it with --profile px4".into(),
            Some(Stack::Ardupilot) => {
                "the controller is ArduPilot: fly it with --profile ardupilot".into()
            }
            None => format!(
                "the controller is neither PX4 nor ArduPilot (MAV_AUTOPILOT {autopilot}): \
                 connect one of these"
            ),
        }
    }
}
