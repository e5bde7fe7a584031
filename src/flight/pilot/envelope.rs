//! Commands on their way to the surfaces pass the envelope filter, whoever gave them.

use super::{Pilot, due};
use greylag_control::Observation;
use greylag_control::envelope::{EnvelopeFilter, Limit};
use greylag_link::autopilot::Severity;
use greylag_physics::Command;

impl Pilot {
    /// Keeps every command of a controller inside the envelope by what `filter` predicts. Where a flight controller flies
    /// attitudes by itself, its own protection stays and this one has no say.
    pub fn protect_with(&mut self, mut filter: EnvelopeFilter) {
        filter.keep_to(&self.config.envelope);
        self.envelope = Some(filter);
    }

    /// `command`, or the nearest one inside the envelope.
    pub(super) fn inside_envelope(&mut self, command: Command, seen: &Observation) -> Command {
        let Some(filter) = self.envelope.as_mut().filter(|_| !self.by_attitude) else {
            return command;
        };
        let filtered = filter.filter(seen, command);
        let distrusted = filtered.by == Some(Limit::Distrust);
        if distrusted && due(&mut self.complaints.envelope, self.clock) {
            self.texts.say(
                Severity::Warning,
                "the model does not predict this flight: load factor and incidence are not limited",
            );
        }
        filtered.command
    }
}
