//! A controller that flies a schedule with another controller.

use super::Schedule;
use crate::control::{Controller, Observation, Target};
use crate::physics::{Command, Time};

/// An inner controller towards a schedule's targets, with the schedule's excitation on top.
///
/// The schedule begins with the first command after a reset.
pub struct Scheduled {
    inner: Box<dyn Controller>,
    schedule: Schedule,
    start: Option<Time>,
}

impl Scheduled {
    /// `inner` on `schedule`.
    pub fn new(inner: Box<dyn Controller>, schedule: Schedule) -> Scheduled {
        Scheduled { inner, schedule, start: None }
    }
}

impl Controller for Scheduled {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn reset(&mut self, seed: u64) {
        self.start = None;
        self.inner.reset(seed);
    }

    /// The target is the schedule's; the one given is not looked at.
    fn command(&mut self, seen: &Observation, _target: &Target) -> Command {
        let start = *self.start.get_or_insert(seen.time);
        let (target, added) = self.schedule.at(seen.time.since(start).as_secs_f64());
        let command = self.inner.command(seen, &target);
        Command {
            aileron: command.aileron + added.aileron,
            elevator: command.elevator + added.elevator,
            throttle: command.throttle + added.throttle,
        }
        .clamped()
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(Scheduled {
            inner: self.inner.boxed_clone(),
            schedule: self.schedule.clone(),
            start: self.start,
        })
    }
}
