//! The flight-test schedule that a pilot flies in offboard, if it was given one.

use super::texts::Texts;
use greylag_control::Target;
use greylag_link::autopilot::Severity;
use greylag_manoeuvres::{Demand, Overlay, Schedule};
use greylag_physics::{Command, Time};

/// Where a schedule stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Waiting,
    Flying,
    Over,
}

/// A schedule in the pilot's hands: it wishes for targets as a client does, and adds its excitation to
/// the command; envelope, slew limits, airspeed protection and failsafes come after it.
#[derive(Debug)]
pub(super) struct Programme {
    name: String,
    overlay: Overlay,
    demand: Option<Demand>,
    stage: Stage,
}

impl Programme {
    /// `schedule`, not begun.
    pub(super) fn new(schedule: Schedule) -> Programme {
        let name = schedule.name.clone();
        Programme { name, overlay: Overlay::new(schedule), demand: None, stage: Stage::Waiting }
    }

    /// Goes back to the start, as when offboard is left.
    pub(super) fn stop(&mut self) {
        self.overlay.reset();
        (self.demand, self.stage) = (None, Stage::Waiting);
    }

    /// What it wishes for at `now`; the first call begins it.
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

    /// The command with the excitation of the last wish, if it is flown now.
    pub(super) fn excite(&mut self, own: Command) -> Command {
        match self.demand.take() {
            Some(demand) => self.overlay.command(&demand, own),
            None => own,
        }
    }
}
