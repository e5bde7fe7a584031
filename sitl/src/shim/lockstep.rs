//! Lockstep: each step waits for the companion's answer to the frame before it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::answer::Answer;
use super::error::ShimError;
use super::faults::Faults;
use super::flight::{Flight, Over};
use super::session::Session;
use super::summary::Event;
use super::telemetry::{FRAME_US, StateFrame, encode_slow};

/// Time after which a frame without an answer is sent again.
const REPEAT: Duration = Duration::from_secs(1);
/// Time after which a frame that the fault rule dropped is sent again.
const REPEAT_LOST: Duration = Duration::from_millis(20);

/// Runs until a stop request or the end of the flight.
pub fn fly(
    session: &mut Session<'_>,
    flight: &mut Flight,
    faults: &mut Faults,
    stop: &AtomicBool,
) -> Result<Option<Over>, ShimError> {
    let mut answers = Vec::new();
    loop {
        let (frame, measured) = flight.measure();
        session.time_us = frame.time_us;
        session.counts.frames += 1;
        let home = flight.home_m();
        session.send_slow(|encoder, out| encode_slow(frame.time_us, &measured, home, encoder, out));
        let Some(answer) = ask(session, &frame, faults, stop, &mut answers) else {
            return Ok(None);
        };
        session.use_answer(&answer);
        if answer.armed && !flight.is_launched() {
            flight.launch();
            session.notify(Event::Launched);
        }
        if let Some(over) = flight.advance(answer.inputs)? {
            return Ok(Some(over));
        }
    }
}

/// Times and number of transmissions of a frame that is not yet answered.
struct Asking {
    since: Instant,
    next: Instant,
    sent: Instant,
    sendings: u64,
    paused: bool,
}

/// Sends `frame` until it is answered; `None` after a stop request.
fn ask(
    session: &mut Session<'_>,
    frame: &StateFrame,
    faults: &mut Faults,
    stop: &AtomicBool,
    answers: &mut Vec<Answer>,
) -> Option<Answer> {
    let since = Instant::now();
    let next = since + faults.lateness();
    let mut asking = Asking { since, next, sent: since, sendings: 0, paused: false };
    while !stop.load(Ordering::Relaxed) {
        send_if_due(session, frame, faults, &mut asking);
        answers.clear();
        session.receive(answers);
        if let Some(answer) = pick(session, frame.time_us, answers) {
            session.counts.latency.record(asking.sent.elapsed());
            if asking.paused {
                session.notify(Event::Resumed);
            }
            return Some(answer);
        }
        let now = Instant::now();
        session.watch(now);
        if !asking.paused && session.is_alive() && now - asking.since >= REPEAT {
            asking.paused = true;
            session.notify(Event::Paused);
        }
    }
    None
}

fn send_if_due(
    session: &mut Session<'_>,
    frame: &StateFrame,
    faults: &mut Faults,
    asking: &mut Asking,
) {
    let now = Instant::now();
    let reachable = session.take_newly_reachable();
    if now < asking.next && !reachable {
        return;
    }
    if asking.sendings > 0 {
        session.counts.repeated_frames += 1;
        session.send_heartbeat();
    }
    asking.sendings += 1;
    let bytes = session.encode(frame);
    if faults.drops() {
        session.counts.dropped_frames += 1;
        asking.next = now + REPEAT_LOST;
    } else {
        session.send_frame(&bytes);
        asking.sent = now;
        asking.next = now + REPEAT;
    }
}

/// The answer to the frame of `time_us`, µs; all other answers are counted.
fn pick(session: &mut Session<'_>, time_us: u64, answers: &[Answer]) -> Option<Answer> {
    let mut picked = None;
    for answer in answers {
        let echo = answer.echo_us;
        if echo == time_us && picked.is_none() {
            picked = Some(*answer);
        } else if echo <= time_us && echo > 0 && echo.is_multiple_of(FRAME_US) {
            session.counts.repeated_answers += 1;
        } else {
            session.counts.wrong_answers += 1;
        }
    }
    picked
}
