//! The hand-offs between control and planner, control and recorder, in some thousands of orders of their threads' steps.
//!
//! The sources are those of the companion; only `crate::threads` is another one here, made of shuttle's parts.

use std::time::{Duration, Instant};

use greylag::control::{Controller, Observation, Target};
use greylag::flight::pilot::{Plan, Request};
use greylag::flight::runtime::Pace;
use greylag::physics::{ActuatorState, Command, State, Time};
use shuttle::rand::{Rng, thread_rng};
use shuttle::sync::Mutex;

#[path = "../src/flight/recorder/queue.rs"]
mod queue;
#[path = "../src/flight/runtime/planner/threaded.rs"]
mod threaded;
#[path = "interleavings_support/threads.rs"]
#[allow(dead_code, unused_imports)]
mod threads;

mod pilot {
    pub use greylag::flight::pilot::{Plan, Request};
}

mod runtime {
    pub use greylag::flight::runtime::Pace;
}

use queue::Queue;
use threaded::Threaded;
use threads::{Arc, Receiver};

/// Orders of the threads' steps in each test.
const ORDERS: usize = 3000;
/// Changes of thread that an order is built around: most faults need one to three (Burckhardt et al., ASPLOS 2010).
const DEPTH: usize = 3;

/// `body` in many orders: drawn step by step, and by probabilistic concurrency testing.
fn in_many_orders(body: impl Fn() + Send + Sync + Copy + 'static) {
    shuttle::check_random(body, ORDERS);
    shuttle::check_pct(body, ORDERS, DEPTH);
}

/// Its throttle counts its engagements, its aileron says what it was asked for.
#[derive(Clone)]
struct Counting {
    engaged: f64,
}

impl Controller for Counting {
    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }
    fn name(&self) -> &'static str {
        "counting"
    }
    fn reset(&mut self, _: u64) {
        self.engaged += 1.0;
    }
    fn command(&mut self, seen: &Observation, _: &Target) -> Command {
        shuttle::thread::yield_now();
        Command { throttle: self.engaged, aileron: seen.altitude, ..Command::IDLE }
    }
    fn prepare(&mut self) {
        shuttle::thread::yield_now();
    }
}

fn request(altitude: f64, engage: bool) -> Request {
    let observation = Observation {
        time: Time::default(),
        state: State::NEUTRAL,
        incidence_sd: [0.0; 2],
        actuators: ActuatorState::default(),
        altitude,
        previous: [Command::IDLE; 2],
    };
    let target = Target { roll: 0.0, pitch: 0.0, airspeed: 20.0 };
    Request { observation, target, overruled: None, engage }
}

fn planner(pace: Pace) -> Threaded {
    let controller = Counting { engaged: 0.0 };
    Threaded::start(Box::new(controller), Duration::ZERO, pace).unwrap()
}

#[test]
fn a_plan_that_flies_is_of_its_tick_and_knows_the_last_engagement() {
    in_many_orders(|| {
        let mut planner = planner(Pace::RealTime);
        let (mut asked, mut known, mut pending) = (0.0, 0.0, false);
        for tick in 1..=8 {
            let engage = tick == 1 || thread_rng().gen_bool(0.3);
            asked += f64::from(u8::from(engage));
            pending |= engage;
            match planner.plan(&request(f64::from(tick), engage), Instant::now()) {
                Plan::Ready(command) => {
                    assert_eq!(command.aileron, f64::from(tick), "a plan of another tick");
                    // one may stand for all that were asked for while it was busy
                    let engaged = command.throttle;
                    assert!(engaged <= asked, "{engaged} engagements of {asked}");
                    assert_eq!(engaged > known, pending, "{engaged} after {known}");
                    (known, pending) = (engaged, false);
                }
                Plan::Late | Plan::Busy => {}
                Plan::None => panic!("the planner lives"),
            }
        }
    });
}

#[test]
fn in_lockstep_each_tick_has_its_plan() {
    in_many_orders(|| {
        let mut planner = planner(Pace::Lockstep);
        for tick in 1..=6 {
            let plan = planner.plan(&request(f64::from(tick), tick == 1), Instant::now());
            let expected = Command { throttle: 1.0, aileron: f64::from(tick), ..Command::IDLE };
            assert_eq!(plan, Plan::Ready(expected));
        }
    });
}

/// What is written down by the thread of a queue, slowly.
fn written(entries: Receiver<u32>, seen: &Mutex<Vec<u32>>) -> usize {
    let mut count = 0;
    for entry in entries {
        shuttle::thread::yield_now();
        seen.lock().unwrap().push(entry);
        count += 1;
    }
    count
}

#[test]
fn each_entry_is_written_in_its_order_or_counted_as_dropped() {
    in_many_orders(|| {
        let seen = Arc::new(Mutex::new(Vec::new()));
        let book = seen.clone();
        let mut queue = Queue::start("recorder", 2, move |all| written(all, &book)).unwrap();
        let mut dropped = Vec::new();
        for entry in 0..8 {
            let before = queue.dropped();
            queue.hand_over(entry);
            if queue.dropped() > before {
                dropped.push(entry);
            }
        }
        let count = queue.close();
        let seen = seen.lock().unwrap();
        assert_eq!((count, count + dropped.len()), (seen.len(), 8));
        assert!(seen.is_sorted(), "{seen:?}");
        assert!(seen.iter().all(|entry| !dropped.contains(entry)));
        assert_eq!(queue.dropped() as usize, dropped.len());
    });
}

#[test]
fn a_thread_that_ends_early_costs_entries_and_holds_nobody_up() {
    in_many_orders(|| {
        let first = |all: Receiver<u32>| u32::from(all.into_iter().next().is_some());
        let mut queue = Queue::start("recorder", 2, first).unwrap();
        (0..8).for_each(|entry| queue.hand_over(entry));
        assert_eq!(queue.close(), 1);
        assert!((5..8).contains(&queue.dropped()), "{}", queue.dropped());
    });
}
