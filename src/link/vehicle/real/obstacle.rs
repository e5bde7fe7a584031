//! Conditions that prevent engagement, as texts with their remedies.

use super::profile::{Authority, Stack};
use super::{ENOUGH, GONE, Real};
use crate::framing::Source;

/// Text for a controller that requires signatures while this companion does not sign.
const SHUT_OUT: &str = "the controller signs its frames and ignores ours, which carry no right \
                        signature: give its key with --sign and add --sign-vehicle";

impl Real {
    /// Warning about an RC transmitter while surfaces are commanded; `None` without one. When the overrides end,
    /// ArduPlane returns to the transmitter's sticks in MANUAL. It leaves MANUAL only by its ground-station failsafe.
    /// The companion acts as that ground station.
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

    /// Whether the controller signs its frames and has not replied to any parameter request.
    pub fn is_shut_out(&self) -> bool {
        self.signs && self.parameters.is_silent()
    }

    /// Reason for which the controller refused the stream `id`, with the remedy; `None` if it did not refuse.
    pub fn denial(&self, id: u32) -> Option<String> {
        self.requests.words(self.profile.stack).filter(|_| self.requests.is_denied(id))
    }

    /// Reason for which control authority cannot be taken now, with the remedy; `None` if it can be taken.
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

    /// Reason for a refusal, if another component of the aircraft's system sends heartbeats.
    ///
    /// ArduPlane identifies its ground station by the system id alone, and this companion uses the aircraft's system
    /// id. If the companion fails, heartbeats of another component keep the ground-station failsafe from acting. The
    /// aircraft would then stay on the radio's sticks.
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

    /// Text about a required stream whose rate is too low; `None` without such a stream.
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
