//! Periodic tasks of the link to a flight controller: heartbeat, watchdog, and requests of streams, parameters and modes. While
//! the companion has control authority, the flight controller executes its commands.

use std::time::Duration;

use super::profile::{Authority, Stack};
use super::{ENOUGH, GONE, Real};
use crate::autopilot::Severity;
use crate::framing::Source;
use crate::wire::controller as wire;

const HEARTBEAT: Duration = Duration::from_secs(1);
/// Interval between latency measurements.
const TIME_SYNC: Duration = Duration::from_millis(200);
/// Largest age of the newest state. If the state is older, control authority is returned to the flight controller.
const BLIND: Duration = Duration::from_millis(300);
/// Time without messages of the companion after which the flight controller's own failsafe acts (COM_RC_LOSS_T,
/// RC_OVERRIDE_TIME, …).
const DEAD: Duration = Duration::from_millis(500);

impl Real {
    /// Returns the frames that are due at `host` without being replies: heartbeat, requests, and the return of control
    /// authority. `None` if there are none.
    pub fn due(&mut self, host: Duration) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        self.now = host;
        if host >= self.next_heartbeat {
            self.next_heartbeat = host + HEARTBEAT;
            let message = wire::heartbeat(self.engagement.steers());
            bytes.extend(self.write(&message));
        }
        if let Some(to) = self.target() {
            self.watch(host);
            self.ask(host, to, &mut bytes);
            self.request_mode(host, to, &mut bytes);
        }
        (!bytes.is_empty()).then_some(bytes)
    }

    /// Handles a stall of this computer for the time `missed`, see [`crate::vehicle::Vehicle::excuse`]. After a stall longer
    /// than 0.5 s the flight controller's own failsafe is active. Control authority is then returned.
    pub fn excuse(&mut self, missed: Duration) {
        if self.engagement.steers() && missed > DEAD {
            self.hand_back(format!("this computer stalled for {:.1} s", missed.as_secs_f64()));
        }
        self.last_state = self.last_state.map(|at| at + missed);
        if let Some(controller) = &mut self.controller {
            controller.heard += missed;
        }
        self.pulse.rest();
    }

    /// Returns control authority to the flight controller if its heartbeats or states are missing, if control cycles of this
    /// computer are missing or too many frames are lost while surfaces are commanded, or if the flight controller does not enter
    /// the requested mode in time.
    fn watch(&mut self, host: Duration) {
        if !self.engagement.steers() {
            self.pulse.rest();
            return self.remind(host);
        }
        // a flight controller that tracks commanded attitudes tolerates slow commands
        let surfaces = self.profile.authority == Authority::Surfaces;
        let scarce = self.pulse.cycle(host, self.survey.frames()).filter(|_| surfaces);
        let age = |at: Duration| host.saturating_sub(at);
        let silent = self.controller.is_none_or(|c| age(c.heard) > GONE);
        let blind = self.last_state.is_none_or(|at| age(at) > BLIND);
        let steered = self.profile.stack.steered(self.profile.authority).name;
        if silent {
            self.hand_back("no heartbeat of the controller for 3 s".into());
        } else if blind {
            self.hand_back("no state of the vehicle for 0.3 s".into());
        } else if let Some(words) = scarce {
            self.hand_back(words);
        } else if let Some(why) =
            self.engagement.overdue(host, self.profile.stack, self.profile.authority)
        {
            self.hand_back(format!("the controller did not enter {steered}: {why}"));
        }
    }

    /// Warns if the flight controller has not confirmed the return of control authority.
    fn remind(&mut self, host: Duration) {
        if self.engagement.unconfirmed(host) {
            let (steered, hold) =
                (self.profile.stack.steered(self.profile.authority), self.profile.stack.hold());
            let words = format!(
                "hand-back not confirmed: the controller may still be in {}; take over by radio or \
                 set {}",
                steered.name, hold.name
            );
            self.say(Severity::Critical, words);
        }
    }

    /// Requests message streams that are too slow and parameters that are not yet known, and measures the latency.
    fn ask(&mut self, host: Duration, to: Source, bytes: &mut Vec<u8>) {
        let first = self.survey.is_new() && self.survey.messages().count() <= 1;
        if self.survey.turn(host) || first {
            self.requests.turn();
            if let Some(words) = self.requests.complaint(self.profile.stack) {
                self.say(Severity::Error, words);
            }
            for stream in self.profile.stack.streams() {
                let thin = self.survey.hz(stream.id) < ENOUGH * stream.hz;
                if thin && self.requests.ask(stream.id) {
                    let message = wire::message_interval(to, stream.id, (1e6 / stream.hz) as f32);
                    bytes.extend(self.write(&message));
                }
            }
        }
        for name in self.parameters.due(host) {
            let message = wire::parameter_request(to, name);
            bytes.extend(self.write(&message));
        }
        if host >= self.next_sync {
            self.next_sync = host + TIME_SYNC;
            let message = wire::time_sync(host.as_nanos() as i64, to);
            bytes.extend(self.write(&message));
        }
    }

    fn request_mode(&mut self, host: Duration, to: Source, bytes: &mut Vec<u8>) {
        let Some(steer) = self.engagement.request(host) else { return };
        let stack = self.profile.stack;
        let mode = if steer { stack.steered(self.profile.authority) } else { stack.hold() };
        let message = wire::set_mode(to, mode.main, mode.sub);
        bytes.extend(self.write(&message));
        if !steer && (stack, self.profile.authority) == (Stack::Ardupilot, Authority::Surfaces) {
            // control of the RC channels is returned to the RC transmitter
            let message = wire::channels_override(to, [0; 3]);
            bytes.extend(self.write(&message));
        }
    }
}
