//! The flight-test schedule, if one is flown in OFFBOARD.

use super::texts::Texts;
use greylag_control::Target;
use greylag_link::autopilot::Severity;
use greylag_manoeuvres::{Demand, Overlay, Schedule};
use greylag_physics::{Command, Time};

/// Phase of a schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Waiting,
    Flying,
    Over,
}

/// A schedule under the pilot. It supplies targets as a client does and adds its excitation to the command. Envelope,
/// slew limits, airspeed protection and failsafes apply afterwards.
#[derive(Debug)]
pub(super) struct Programme {
    name: String,
    overlay: Overlay,
    demand: Option<Demand>,
    stage: Stage,
}

impl Programme {
    /// A programme of `schedule` that has not started.
    pub(super) fn new(schedule: Schedule) -> Programme {
        let name = schedule.name.clone();
        Programme { name, overlay: Overlay::new(schedule), demand: None, stage: Stage::Waiting }
    }

    /// Returns to the start of the schedule, for instance when OFFBOARD ends.
    pub(super) fn stop(&mut self) {
        self.overlay.reset();
        (self.demand, self.stage) = (None, Stage::Waiting);
    }

    /// The target at `now`. The first call starts the schedule.
    pub(super) fn wish(&mut self, now: Time, texts: &mut Texts) -> Target {
        let demand = self.overlay.demand(now);
        let over = self.overlay.is_over(now);
        let stage = if over { Stage::Over } else { Stage::Flying };
        if stage != self.stage {
            let words = if over { "is over: wings level" } else { "begins" };
            texts.say(Severity::Notice, format!("schedule {} {words}", self.name));
        }
        (self.demand, self.stage) = (Some(demand), stage);
        demand.target
    }

    /// Adds the excitation of the schedule to the command `own`. Returns `own` unchanged if no target was requested
    /// since the last call.
    pub(super) fn excite(&mut self, own: Command) -> Command {
        match self.demand.take() {
            Some(demand) => self.overlay.command(&demand, own),
            None => own,
        }
    }
}
