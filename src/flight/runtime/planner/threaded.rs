//! A controller on a separate thread. Its plan, the command for one tick, is used at the tick of its request or not at all.

use std::time::{Duration, Instant};

use crate::pilot::{Plan, Request};
use crate::runtime::Pace;
use crate::threads::{Builder, JoinHandle, Receiver, RecvTimeoutError, Sender, bounded};
use greylag_control::Controller;
use greylag_physics::Command;

/// A controller on a separate thread.
pub struct Threaded {
    requests: Option<Sender<(u64, Request)>>,
    pub(super) plans: Receiver<(u64, Command)>,
    thread: Option<JoinHandle<()>>,
    tick: u64,
    /// Whether the controller must be reset at the next request. It was busy when it was last put in charge, so the request to
    /// reset it was not delivered.
    owed: bool,
    pub(super) deadline: Duration,
    pace: Pace,
}

impl Threaded {
    /// Starts the thread. In real time, a plan is late if it is not ready `deadline` after the arrival of its state frame. In
    /// lockstep there is no deadline.
    pub fn start(
        mut controller: Box<dyn Controller>,
        deadline: Duration,
        pace: Pace,
    ) -> std::io::Result<Self> {
        let (requests, orders) = bounded::<(u64, Request)>(1);
        let (answers, plans) = bounded(2);
        let work = move || {
            for (tick, request) in orders {
                if answers.send((tick, request.ask(controller.as_mut()))).is_err() {
                    return;
                }
                controller.prepare();
            }
        };
        let thread = Builder::new().name("planner".into()).spawn(work)?;
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

    /// Requests a plan and waits for it. `arrived` is the time at which the state of `request` arrived.
    pub fn plan(&mut self, request: &Request, arrived: Instant) -> Plan {
        self.tick += 1;
        // plans for earlier ticks are obsolete
        while self.plans.try_recv().is_ok() {}
        let engage = request.engage || self.owed;
        let Some(requests) = &self.requests else {
            return Plan::None;
        };
        match requests.try_send((self.tick, Request { engage, ..*request })) {
            Ok(()) => {}
            // the controller's thread has ended; the fallback flies
            Err(error) if error.is_disconnected() => return Plan::None,
            Err(_) => {
                self.owed = engage;
                return Plan::Busy;
            }
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
                // the controller's thread has ended; the fallback flies
                Err(RecvTimeoutError::Disconnected) => return Plan::None,
            }
        }
    }
}

impl Drop for Threaded {
    fn drop(&mut self) {
        self.requests = None;
        // the thread may be blocked because nobody has fetched its last plans
        while self.plans.recv().is_ok() {}
        if let Some(thread) = self.thread.take() {
            // a panic of the controller has been reported by its thread
            let _ = thread.join();
        }
    }
}
