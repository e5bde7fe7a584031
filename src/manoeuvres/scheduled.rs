//! A controller that flies a schedule with another controller. A schedule is a sequence of targets, with excitations of the
//! controls for system identification.

use crate::{Demand, Schedule};
use greylag_control::{Controller, Observation, Target};
use greylag_physics::{Command, Time};

/// A schedule in progress. Its excitation is added to a controller's commands.
#[derive(Clone, Debug)]
pub struct Overlay {
    schedule: Schedule,
    start: Option<Time>,
    /// For each control whose excitation reduces the controller's reaction: the controller's command at the start of this
    /// excitation. `None` for a control with full reaction.
    held: [Option<f64>; 4],
}

impl Overlay {
    /// An overlay with `schedule`, which starts at the first call of [`Overlay::demand`].
    pub fn new(schedule: Schedule) -> Overlay {
        Overlay { schedule, start: None, held: [None; 4] }
    }

    /// Resets the overlay to its state before the start of the schedule.
    pub fn reset(&mut self) {
        (self.start, self.held) = (None, [None; 4]);
    }

    /// Target and excitation at `now`. The first call starts the schedule.
    pub fn demand(&mut self, now: Time) -> Demand {
        let start = *self.start.get_or_insert(now);
        self.schedule.at(now.since(start).as_secs_f64())
    }

    /// Whether the schedule has ended at `now`. False before its start.
    pub fn is_over(&self, now: Time) -> bool {
        self.start.is_some_and(|start| now.since(start).as_secs_f64() >= self.schedule.duration())
    }

    /// Adds the excitation to the controller's command `own`. During an excitation that reduces the controller's reaction, only
    /// the fraction [`Demand::authority`] of the change of `own` since the start of the excitation is applied. The result is
    /// clamped to the ranges of the controls.
    pub fn command(&mut self, demand: &Demand, own: Command) -> Command {
        let mut of = |axis: usize, own: f64, added: f64| {
            let share = demand.authority[axis];
            if share == 1.0 {
                self.held[axis] = None;
                return own + added;
            }
            let held = *self.held[axis].get_or_insert(own);
            held + share * (own - held) + added
        };
        Command {
            aileron: of(0, own.aileron, demand.added.aileron),
            elevator: of(1, own.elevator, demand.added.elevator),
            throttle: of(2, own.throttle, demand.added.throttle),
            rudder: of(3, own.rudder, demand.added.rudder),
        }
        .clamped()
    }
}

/// A controller that tracks a schedule's targets with an inner controller and adds the schedule's excitation.
///
/// The schedule starts with the first command after a reset.
pub struct Scheduled {
    inner: Box<dyn Controller>,
    overlay: Overlay,
}

impl Scheduled {
    /// A controller that flies `schedule` with `inner`.
    pub fn new(inner: Box<dyn Controller>, schedule: Schedule) -> Scheduled {
        Scheduled { inner, overlay: Overlay::new(schedule) }
    }
}

impl Controller for Scheduled {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn reset(&mut self, seed: u64) {
        self.overlay.reset();
        self.inner.reset(seed);
    }

    /// Flies to the schedule's target and ignores the argument `_target`.
    fn command(&mut self, seen: &Observation, _target: &Target) -> Command {
        let demand = self.overlay.demand(seen.time);
        let own = self.inner.command(seen, &demand.target);
        self.overlay.command(&demand, own)
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(Scheduled { inner: self.inner.boxed_clone(), overlay: self.overlay.clone() })
    }
}
