//! The pilot's use of the envelope limiter. It limits the surface commands of the controller, of the fallback controller and
//! of a flight-test schedule.

use super::{Pilot, due};
use greylag_control::Observation;
use greylag_control::envelope::{EnvelopeLimiter, Limit};
use greylag_link::autopilot::Severity;
use greylag_physics::Command;

impl Pilot {
    /// Limits commands to the envelope with `limiter` from now on. Stick inputs, held commands, the level trim, and the aileron
    /// that brings an upset aircraft back to wings level are not limited. If the companion commands attitudes to a flight
    /// controller, only that controller's own protection applies.
    pub fn protect_with(&mut self, mut limiter: EnvelopeLimiter) {
        limiter.keep_to(&self.config.envelope);
        self.envelope = Some(limiter);
    }

    /// The envelope limiter; `None` if commands are not limited.
    pub fn protection(&self) -> Option<&EnvelopeLimiter> {
        self.envelope.as_ref()
    }

    /// The command nearest to `command` inside the envelope. Without a limiter, or if attitudes are commanded, it is `command`
    /// itself.
    pub(super) fn inside_envelope(&mut self, command: Command, seen: &Observation) -> Command {
        let Some(limiter) = self.envelope.as_mut().filter(|_| !self.by_attitude) else {
            return command;
        };
        let limited = limiter.limit(seen, command);
        self.overruled = limited.overruled(command);
        let distrusted = limited.by == Some(Limit::Distrust);
        if distrusted && due(&mut self.complaints.envelope, self.clock) {
            self.texts.say(
                Severity::Warning,
                "the model does not predict this flight: load factor and incidence are not limited",
            );
        }
        limited.command
    }
}
