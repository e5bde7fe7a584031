//! The planner, which is the controller that the pilot asks for a command in each tick of 10 ms. It runs in the control loop or
//! on a thread of its own.

mod threaded;

use std::time::Instant;

use crate::pilot::{Plan, Request};
use greylag_control::Controller;
pub(super) use threaded::Threaded;

/// The controller of the flight and where it runs.
pub(super) enum Planner {
    /// A controller that is fast enough for the control loop.
    Inline(Box<dyn Controller>),
    /// A slow controller on a thread of its own. A plan (its command for a tick) is used at the tick of its request or never.
    Threaded(Threaded),
}

impl Planner {
    /// The plan for `request`, whose state arrived at `arrived`. In real time, the wait for a threaded plan ends at its deadline.
    pub(super) fn plan(&mut self, request: &Request, arrived: Instant) -> Plan {
        match self {
            Planner::Inline(controller) => Plan::Ready(request.ask(controller.as_mut())),
            Planner::Threaded(threaded) => threaded.plan(request, arrived),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::Pace;
    use crate::threads::{Receiver, Sender, bounded};
    use greylag_control::{Observation, Target};
    use greylag_physics::{ActuatorState, Command, State, Time};
    use std::time::Duration;

    /// An arbitrary planning request.
    fn any_request(engage: bool) -> Request {
        let observation = Observation {
            time: Time::default(),
            state: State::NEUTRAL,
            incidence_sd: [0.0; 2],
            actuators: ActuatorState::default(),
            altitude: 600.0,
            previous: [Command::IDLE; 2],
        };
        let target = Target { roll: 0.0, pitch: 0.0, airspeed: 20.0 };
        Request { observation, target, overruled: None, engage }
    }

    /// A controller that can be made to wait in a plan until it is released. In its commands, the throttle is 0.1 per reset and
    /// the aileron 0.1 per plan, so that a test can count both.
    #[derive(Clone)]
    struct Held {
        begun: Sender<()>,
        gate: Receiver<()>,
        waits: Vec<bool>,
        engaged: f64,
        planned: f64,
    }

    impl Controller for Held {
        fn boxed_clone(&self) -> Box<dyn Controller> {
            Box::new(self.clone())
        }
        fn name(&self) -> &'static str {
            "held"
        }
        fn reset(&mut self, _seed: u64) {
            self.engaged += 0.1;
        }
        fn command(&mut self, _: &Observation, _: &Target) -> Command {
            self.planned += 0.1;
            self.begun.send(()).unwrap();
            if self.waits.pop().unwrap_or_default() {
                self.gate.recv().unwrap();
            }
            Command { throttle: self.engaged, aileron: self.planned, ..Command::IDLE }
        }
    }

    /// A planner with a channel that signals the start of each plan, and a channel that releases a waiting plan.
    struct Bench {
        planner: Threaded,
        begun: Receiver<()>,
        go: Sender<()>,
    }

    impl Bench {
        /// Starts a planner. `waits` has one entry per plan, in order: whether this plan waits for a release.
        fn new(pace: Pace, waits: &[bool]) -> Bench {
            let ((begun, started), (go, gate)) = (bounded(9), bounded(9));
            let waits = waits.iter().rev().copied().collect();
            let controller = Held { begun, gate, waits, engaged: 0.0, planned: 0.0 };
            let planner = Threaded::start(Box::new(controller), Duration::ZERO, pace).unwrap();
            Bench { planner, begun: started, go }
        }

        /// Requests a plan with a deadline that any machine meets.
        fn in_time(&mut self, engage: bool) -> Plan {
            self.planner.deadline = Duration::from_secs(60);
            self.planner.plan(&any_request(engage), Instant::now())
        }

        /// Requests a plan with a deadline of 5 ms, which a waiting controller misses.
        fn too_late(&mut self, engage: bool) -> Plan {
            self.planner.deadline = Duration::from_millis(5);
            self.planner.plan(&any_request(engage), Instant::now())
        }

        /// Blocks until `plans` late plans have arrived.
        fn done(&self, plans: usize) {
            while self.planner.plans.len() < plans {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }

    fn ready(throttle: f64, aileron: f64) -> Plan {
        Plan::Ready(Command { throttle, aileron, ..Command::IDLE })
    }

    #[test]
    fn a_plan_that_misses_its_tick_is_never_used_at_a_later_one() {
        let mut bench = Bench::new(Pace::RealTime, &[false, true]);
        assert_eq!(bench.in_time(true), ready(0.1, 0.1));
        assert_eq!(bench.too_late(false), Plan::Late);
        bench.go.send(()).unwrap();
        bench.done(1);
        assert_eq!(bench.in_time(false), ready(0.1, 0.1 + 0.1 + 0.1));
    }

    #[test]
    fn an_engagement_during_a_late_plan_is_told_afterwards() {
        let mut bench = Bench::new(Pace::RealTime, &[true]);
        assert_eq!(bench.too_late(true), Plan::Late);
        bench.begun.recv().unwrap();
        // the controller is still waiting: the next request enters the queue, and the one after it finds the queue full
        assert_eq!(bench.too_late(false), Plan::Late);
        assert_eq!(bench.too_late(true), Plan::Busy);
        bench.go.send(()).unwrap();
        bench.done(2);
        assert_eq!(bench.in_time(false), ready(0.2, 0.1 + 0.1 + 0.1));
    }

    /// A controller that panics when it is asked for a command.
    #[derive(Clone)]
    struct Failing;

    impl Controller for Failing {
        fn boxed_clone(&self) -> Box<dyn Controller> {
            Box::new(self.clone())
        }
        fn name(&self) -> &'static str {
            "failing"
        }
        fn reset(&mut self, _seed: u64) {}
        fn command(&mut self, _: &Observation, _: &Target) -> Command {
            panic!("the test's own panic")
        }
    }

    #[test]
    fn a_planner_whose_controller_has_panicked_is_not_called_busy() {
        let failing = Box::new(Failing);
        let mut planner = Threaded::start(failing, Duration::ZERO, Pace::Lockstep).unwrap();
        for _ in 0..3 {
            assert_eq!(planner.plan(&any_request(false), Instant::now()), Plan::None);
        }
    }

    #[test]
    fn in_lockstep_the_plan_is_waited_for() {
        let mut bench = Bench::new(Pace::Lockstep, &[true]);
        let go = bench.go.clone();
        std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(50));
            go.send(()).unwrap();
        });
        let plan = bench.planner.plan(&any_request(false), Instant::now());
        assert_eq!(plan, ready(0.0, 0.1));
    }
}
