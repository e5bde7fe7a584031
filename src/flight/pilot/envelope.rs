//! Commands on their way to the surfaces pass the envelope limiter, whoever gave them.

use super::{Pilot, due};
use greylag_control::Observation;
use greylag_control::envelope::{EnvelopeLimiter, Limit};
use greylag_link::autopilot::Severity;
use greylag_physics::Command;

impl Pilot {
    /// Keeps every command of a controller inside the envelope by what `limiter`'s model predicts. Where a flight controller flies
    /// attitudes by itself, its own protection stays and this one has no say.
    pub fn protect_with(&mut self, mut limiter: EnvelopeLimiter) {
        limiter.keep_to(&self.config.envelope);
        self.envelope = Some(limiter);
    }

    /// What the pilot keeps commands inside the envelope by.
    pub fn protection(&self) -> Option<&EnvelopeLimiter> {
        self.envelope.as_ref()
    }

    /// `command`, or the nearest one inside the envelope.
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
