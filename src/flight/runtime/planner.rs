//! Who computes the plan of a tick: a controller in the loop, or one on a thread of its own.

use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};

use super::Pace;
use crate::control::Controller;
use crate::flight::pilot::{Plan, Request};
use crate::physics::Command;

/// Seed of a controller's random numbers, the same at every engagement.
const SEED: u64 = 0;

/// The controller of the flight, where it runs.
pub(super) enum Planner {
    /// Fast enough to be called in the loop.
    Inline(Box<dyn Controller>),
    /// Slow: on its own thread, its plan used at its tick or not at all.
    Threaded(Threaded),
}

impl Planner {
    /// The plan for `request`, waited for until `deadline` after `arrived` at most.
    pub(super) fn plan(&mut self, request: &Request, arrived: Instant) -> Plan {
        match self {
            Planner::Inline(controller) => Plan::Ready(run(controller.as_mut(), request)),
            Planner::Threaded(threaded) => threaded.plan(request, arrived),
        }
    }
}

fn run(controller: &mut dyn Controller, request: &Request) -> Command {
    if request.engage {
        controller.reset(SEED);
    }
    controller.command(&request.observation, &request.target)
}

/// A controller on its own thread.
pub(super) struct Threaded {
    requests: Option<Sender<(u64, Request)>>,
    plans: Receiver<(u64, Command)>,
    thread: Option<JoinHandle<()>>,
    tick: u64,
    /// An engagement that the planner has not been told of, because it was busy.
    owed: bool,
    deadline: Duration,
    pace: Pace,
}

impl Threaded {
    /// Starts the thread. A plan must be there `deadline` after its state frame; in lockstep it
    /// is waited for.
    pub(super) fn start(
        mut controller: Box<dyn Controller>,
        deadline: Duration,
        pace: Pace,
    ) -> std::io::Result<Self> {
        let (requests, orders) = bounded::<(u64, Request)>(1);
        let (answers, plans) = bounded(2);
        let work = move || {
            for (tick, request) in orders {
                if answers.send((tick, run(controller.as_mut(), &request))).is_err() {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("planner".into()).spawn(work)?;
        Ok(Threaded {
            requests: Some(requests),
            plans,
            thread: Some(thread),
            tick: 0,
            owed: false,
            deadline,
            pace,
        })
    }

    fn plan(&mut self, request: &Request, arrived: Instant) -> Plan {
        self.tick += 1;
        // Plans of earlier ticks are of no use any more.
        while self.plans.try_recv().is_ok() {}
        let engage = request.engage || self.owed;
        let Some(requests) = &self.requests else {
            return Plan::None;
        };
        if requests.try_send((self.tick, Request { engage, ..*request })).is_err() {
            self.owed = engage;
            return Plan::Late;
        }
        self.owed = false;
        self.wait(arrived)
    }

    fn wait(&self, arrived: Instant) -> Plan {
        loop {
            let answer = match self.pace {
                Pace::RealTime => self.plans.recv_deadline(arrived + self.deadline),
                Pace::Lockstep => self.plans.recv().map_err(|_| RecvTimeoutError::Disconnected),
            };
            match answer {
                Ok((tick, command)) if tick == self.tick => return Plan::Ready(command),
                Ok(_) => {}
                Err(RecvTimeoutError::Timeout) => return Plan::Late,
                // The controller has died; the fallback flies.
                Err(RecvTimeoutError::Disconnected) => return Plan::None,
            }
        }
    }
}

impl Drop for Threaded {
    fn drop(&mut self) {
        self.requests = None;
        // The thread may be at its last plan, with nobody to take it.
        while self.plans.recv().is_ok() {}
        if let Some(thread) = self.thread.take() {
            // A panic there has been reported by its own thread.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{Observation, Target};
    use crate::physics::{ActuatorState, State, Time};

    /// Something to plan for, of no interest beside its being there.
    fn any_request(engage: bool) -> Request {
        let observation = Observation {
            time: Time::default(),
            state: State::NEUTRAL,
            actuators: ActuatorState::default(),
            altitude: 600.0,
            previous: [Command::IDLE; 2],
        };
        Request { observation, target: Target { roll: 0.0, pitch: 0.0, airspeed: 20.0 }, engage }
    }

    /// A controller that takes its time, whose throttle counts its engagements.
    #[derive(Clone)]
    struct Slow {
        takes: Vec<Duration>,
        engaged: f64,
    }

    impl Controller for Slow {
        fn boxed_clone(&self) -> Box<dyn Controller> {
            Box::new(self.clone())
        }
        fn name(&self) -> &'static str {
            "slow"
        }
        fn reset(&mut self, _seed: u64) {
            self.engaged += 0.1;
        }
        fn command(&mut self, _: &Observation, _: &Target) -> Command {
            std::thread::sleep(self.takes.pop().unwrap_or_default());
            Command { throttle: self.engaged, ..Command::IDLE }
        }
    }

    fn threaded(pace: Pace, takes_ms: &[u64]) -> Threaded {
        let takes = takes_ms.iter().rev().map(|ms| Duration::from_millis(*ms)).collect();
        // 50 ms instead of 8, so that a busy machine does not decide the test.
        Threaded::start(Box::new(Slow { takes, engaged: 0.0 }), Duration::from_millis(50), pace)
            .unwrap()
    }

    #[test]
    fn a_plan_that_misses_its_tick_is_never_used_at_a_later_one() {
        let mut planner = threaded(Pace::RealTime, &[0, 200]);
        let engaged = Plan::Ready(Command { throttle: 0.1, ..Command::IDLE });
        assert_eq!(planner.plan(&any_request(true), Instant::now()), engaged);
        let before = Instant::now();
        assert_eq!(planner.plan(&any_request(false), before), Plan::Late);
        assert!(before.elapsed() < Duration::from_millis(150));
        std::thread::sleep(Duration::from_millis(300));
        assert_eq!(planner.plan(&any_request(false), Instant::now()), engaged);
    }

    #[test]
    fn an_engagement_during_a_late_plan_is_told_afterwards() {
        let mut planner = threaded(Pace::RealTime, &[300]);
        assert_eq!(planner.plan(&any_request(true), Instant::now()), Plan::Late);
        // This one waits in the queue, the next finds the queue full.
        assert_eq!(planner.plan(&any_request(false), Instant::now()), Plan::Late);
        assert_eq!(planner.plan(&any_request(true), Instant::now()), Plan::Late);
        std::thread::sleep(Duration::from_millis(400));
        let twice = Plan::Ready(Command { throttle: 0.2, ..Command::IDLE });
        assert_eq!(planner.plan(&any_request(false), Instant::now()), twice);
    }

    #[test]
    fn in_lockstep_the_plan_is_waited_for() {
        let mut planner = threaded(Pace::Lockstep, &[120]);
        assert!(matches!(planner.plan(&any_request(false), Instant::now()), Plan::Ready(_)));
    }
}
