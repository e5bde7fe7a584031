//! Real time: one frame every 10 ms of the wall clock, independent of the companion.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use super::answer::Answer;
use super::error::ShimError;
use super::faults::{Faults, milliseconds};
use super::flight::{Flight, Over};
use super::session::{Received, Session};
use super::summary::Event;
use super::telemetry::{FRAME_US, encode_slow};
use crate::plant::Inputs;

const PERIOD: Duration = Duration::from_micros(FRAME_US);
/// Delay of a cycle beyond which it counts as late.
const LATE: Duration = Duration::from_millis(2);
/// Delay beyond which the schedule restarts at the present time, without a burst of frames.
const HOPELESS: Duration = Duration::from_millis(100);
/// Age beyond which an answer is stale and is not used, µs.
const STALE_US: u64 = 500_000;
/// Intervals between polls of the link while an answer is expected. The first applies within `PUNCTUAL` of the frame, for an
/// accurate measurement of the answer time; the second applies later.
const LOOKS: [Duration; 2] = [Duration::from_micros(100), Duration::from_millis(1)];
/// Time after the frame during which the link is polled at the short interval.
const PUNCTUAL: Duration = Duration::from_millis(4);
/// Largest number of packets handled per poll; further packets wait in the kernel.
const ARRIVALS: usize = 500;
/// Number of frames whose sending times are kept.
const SENT: usize = 64;

/// State of the real-time loop.
struct Cycle<'s, 'o> {
    session: &'s mut Session<'o>,
    /// Frames that wait to be sent: sending time, time stamp of the frame, bytes.
    outbox: VecDeque<(Instant, u64, Vec<u8>)>,
    /// Sending times of the latest frames, indexed by frame number.
    sent: [Option<(u64, Instant)>; SENT],
    answers: Vec<Answer>,
    /// The newest answer since the last step.
    newest: Option<Answer>,
    /// Time of the newest answered frame, µs.
    answered_us: u64,
    first_us: u64,
    now_us: u64,
}

/// Runs until a stop request or the end of the flight; `delay_ms` is the constant delay of the frames, ms.
pub fn fly(
    session: &mut Session<'_>,
    flight: &mut Flight,
    faults: &mut Faults,
    delay_ms: f64,
    stop: &AtomicBool,
) -> Result<Option<Over>, ShimError> {
    let mut cycle = Cycle::new(session, flight.shown_us());
    let mut inputs = Inputs::default();
    let mut deadline = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        deadline = cycle.begin(deadline);
        let due = Instant::now() + milliseconds(delay_ms) + faults.lateness();
        cycle.show(flight, faults, due);
        deadline += PERIOD;
        cycle.converse_until(deadline);
        match cycle.newest.take() {
            Some(answer) => {
                cycle.session.use_answer(&answer);
                inputs = answer.inputs;
                if answer.armed && !flight.is_launched() {
                    flight.launch();
                    cycle.session.notify(Event::Launched);
                }
            }
            None => cycle.session.counts.unanswered_steps += u64::from(flight.is_launched()),
        }
        if let Some(over) = flight.advance(inputs)? {
            return Ok(Some(over));
        }
    }
    Ok(None)
}

impl<'s, 'o> Cycle<'s, 'o> {
    fn new(session: &'s mut Session<'o>, first_us: u64) -> Self {
        Cycle {
            session,
            outbox: VecDeque::new(),
            sent: [None; SENT],
            answers: Vec::new(),
            newest: None,
            answered_us: 0,
            first_us,
            now_us: first_us,
        }
    }

    /// Records the lateness of this cycle and returns the deadline from which the next cycle counts.
    fn begin(&mut self, deadline: Instant) -> Instant {
        let now = Instant::now();
        let late = now.saturating_duration_since(deadline);
        self.session.counts.latest_cycle = self.session.counts.latest_cycle.max(late);
        self.session.counts.late_cycles += u64::from(late > LATE);
        self.session.watch(now);
        if late > HOPELESS {
            self.session.notify(Event::Skipped(late));
            return now;
        }
        deadline
    }

    /// Measures the state and queues its frame for sending.
    fn show(&mut self, flight: &mut Flight, faults: &mut Faults, due: Instant) {
        let (frame, measured) = flight.measure();
        self.now_us = frame.time_us;
        self.session.time_us = frame.time_us;
        self.session.counts.frames += 1;
        let home = flight.home_m();
        self.session
            .send_slow(|encoder, out| encode_slow(frame.time_us, &measured, home, encoder, out));
        let bytes = self.session.encode(&frame);
        if faults.drops() {
            self.session.counts.dropped_frames += 1;
            return;
        }
        // Frames keep their order: a late frame delays those behind it.
        let due = self.outbox.back().map_or(due, |&(before, ..)| due.max(before));
        self.outbox.push_back((due, frame.time_us, bytes));
    }

    /// Sends the frames that are due and receives messages until `deadline`.
    fn converse_until(&mut self, deadline: Instant) {
        let punctual_until = deadline - PERIOD + PUNCTUAL;
        loop {
            self.send_due();
            self.listen();
            let now = Instant::now();
            if now >= deadline {
                return;
            }
            let mut wake = if self.answered_us >= self.now_us {
                deadline
            } else if self.session.is_alive() && now < punctual_until {
                now + LOOKS[0]
            } else {
                now + LOOKS[1]
            };
            if let Some(&(due, ..)) = self.outbox.front() {
                wake = wake.min(due);
            }
            thread::sleep(wake.min(deadline).saturating_duration_since(now));
        }
    }

    fn send_due(&mut self) {
        let now = Instant::now();
        while let Some((due, time_us, bytes)) = self.outbox.pop_front() {
            if due > now {
                self.outbox.push_front((due, time_us, bytes));
                return;
            }
            self.sent[slot(time_us)] = Some((time_us, Instant::now()));
            self.session.send_frame(&bytes);
        }
    }

    fn listen(&mut self) {
        for _ in 0..ARRIVALS {
            self.answers.clear();
            let received = self.session.receive(&mut self.answers);
            for i in 0..self.answers.len() {
                self.judge(self.answers[i]);
            }
            if received == Received::Nothing {
                return;
            }
        }
    }

    /// Keeps the newest valid answer and counts the others.
    fn judge(&mut self, answer: Answer) {
        let echo = answer.echo_us;
        let counts = &mut self.session.counts;
        if echo < self.first_us || echo > self.now_us || !echo.is_multiple_of(FRAME_US) {
            counts.wrong_answers += 1;
        } else if echo <= self.answered_us {
            counts.repeated_answers += 1;
        } else if self.now_us - echo > STALE_US {
            counts.stale_answers += 1;
        } else {
            self.answered_us = echo;
            if let Some((time_us, sent)) = self.sent[slot(echo)]
                && time_us == echo
            {
                counts.latency.record(sent.elapsed());
            }
            self.newest = Some(answer);
        }
    }
}

fn slot(time_us: u64) -> usize {
    (time_us / FRAME_US) as usize % SENT
}
