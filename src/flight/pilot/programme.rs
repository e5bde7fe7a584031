//! A flight-test schedule that the pilot flies in OFFBOARD mode instead of the setpoints of a client (a ground station or an
//! offboard program). It is a sequence of targets (attitudes and airspeeds) and of excitations, which are signals added to a
//! target or a command.

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

/// A schedule and its progress. The limits of envelope and slew rate, the airspeed protection and the failsafes apply to its
/// targets and commands too.
#[derive(Debug)]
pub(super) struct Programme {
    name: String,
    overlay: Overlay,
    demand: Option<Demand>,
    stage: Stage,
}

impl Programme {
    /// Prepares `schedule`, which has not started.
    pub(super) fn new(schedule: Schedule) -> Programme {
        let name = schedule.name.clone();
        Programme { name, overlay: Overlay::new(schedule), demand: None, stage: Stage::Waiting }
    }

    /// Returns to the start of the schedule, for instance when OFFBOARD ends.
    pub(super) fn stop(&mut self) {
        self.overlay.reset();
        (self.demand, self.stage) = (None, Stage::Waiting);
    }

    /// Returns the target at `now`. The first call starts the schedule.
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

    /// Adds the schedule's excitation to the command `own`. Returns `own` unchanged if `wish` was not called since the last
    /// call.
    pub(super) fn excite(&mut self, own: Command) -> Command {
        match self.demand.take() {
            Some(demand) => self.overlay.command(&demand, own),
            None => own,
        }
    }
}
