//! Message exchange with the companion: detects its presence, receives its answers and counts messages.

use std::time::{Duration, Instant};

use super::answer::Answer;
use super::codec::{Encoder, Frame, Heartbeat, HilActuatorControls, Parser};
use super::link::{Address, Arrival, Link};
use super::summary::{Event, Notice, Summary};
use super::telemetry::{StateFrame, encode_heartbeat};

/// System and component ID of the shim.
pub const SHIM: (u8, u8) = (1, 200);
/// System and component ID of the companion.
pub const COMPANION: (u8, u8) = (1, 1);
/// Silence after which the companion counts as lost.
const SILENCE: Duration = Duration::from_secs(2);

/// Whether a receive call returned an arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// Nothing arrived during the wait.
    Nothing,
    /// Bytes arrived, or the state of the link changed.
    Something,
}

/// Message exchange of one run.
pub struct Session<'a> {
    link: Link,
    address: Address,
    parser: Parser,
    encoder: Encoder,
    observer: &'a mut dyn FnMut(Notice),
    /// The counts so far.
    pub counts: Summary,
    /// Simulated time for the time stamps of events, µs.
    pub time_us: u64,
    last_message: Option<Instant>,
    armed: bool,
    newly_reachable: bool,
    frames: Vec<Frame>,
    batch: Vec<u8>,
}

impl<'a> Session<'a> {
    /// Begins a session on an open link.
    pub fn new(link: Link, address: Address, observer: &'a mut dyn FnMut(Notice)) -> Self {
        let local = link.local();
        let mut session = Session {
            link,
            address,
            parser: Parser::default(),
            encoder: Encoder::new(SHIM.0, SHIM.1),
            observer,
            counts: Summary::default(),
            time_us: 0,
            last_message: None,
            armed: false,
            newly_reachable: false,
            frames: Vec::new(),
            batch: Vec::new(),
        };
        session.notify(Event::Open(session.address.clone(), local));
        session.notify(Event::Waiting(session.address.clone()));
        session
    }

    /// Reports `event` to the observer with the present simulated time.
    pub fn notify(&mut self, event: Event) {
        (self.observer)(Notice { time_s: self.time_us as f64 * 1e-6, event });
    }

    /// Whether the companion is present: its last message is at most 2 s old and the link is open.
    pub fn is_alive(&self) -> bool {
        self.last_message.is_some()
    }

    /// Whether the companion has become reachable since the last call of this function.
    pub fn take_newly_reachable(&mut self) -> bool {
        std::mem::take(&mut self.newly_reachable)
    }

    /// The bytes of a state frame, with new sequence numbers.
    pub fn encode(&mut self, frame: &StateFrame) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(320);
        frame.encode(&mut self.encoder, &mut bytes);
        bytes
    }

    /// Sends a state frame, and counts it if it could not be sent.
    pub fn send_frame(&mut self, bytes: &[u8]) {
        self.counts.unsent_frames += u64::from(!self.link.send(bytes));
    }

    /// Sends the bytes that `write` encodes as a separate batch; sends nothing if there are none.
    pub fn send_slow(&mut self, write: impl FnOnce(&mut Encoder, &mut Vec<u8>)) {
        self.batch.clear();
        write(&mut self.encoder, &mut self.batch);
        if !self.batch.is_empty() {
            self.link.send(&self.batch);
        }
    }

    /// Sends an additional heartbeat, for use while simulated time is stopped.
    pub fn send_heartbeat(&mut self) {
        self.send_slow(encode_heartbeat);
    }

    /// Receives one arrival and appends the valid answers in it to `answers`.
    pub fn receive(&mut self, answers: &mut Vec<Answer>) -> Received {
        let mut frames = std::mem::take(&mut self.frames);
        frames.clear();
        let parser = &mut self.parser;
        let mut keep = |frame| frames.push(frame);
        let mut sender = None;
        match self.link.receive() {
            Arrival::Nothing => {
                self.frames = frames;
                return Received::Nothing;
            }
            Arrival::Datagram(bytes, from) => {
                parser.datagram(bytes, &mut keep);
                sender = Some(from);
            }
            Arrival::Bytes(bytes) => parser.stream(bytes, &mut keep),
            Arrival::Connected(_) => {
                parser.restart();
                self.newly_reachable = true;
            }
            Arrival::Closed => {
                parser.restart();
                self.lose();
            }
        }
        for frame in &frames {
            self.take(frame, sender, answers);
        }
        self.frames = frames;
        Received::Something
    }

    fn take(
        &mut self,
        frame: &Frame,
        sender: Option<std::net::SocketAddr>,
        answers: &mut Vec<Answer>,
    ) {
        let known = self.link.peer();
        let stranger = matches!((sender, known), (Some(from), Some(peer)) if from != peer);
        if (frame.system, frame.component) != COMPANION || stranger {
            self.counts.foreign_frames += 1;
            return;
        }
        if let Some(message) = frame.decode::<HilActuatorControls>() {
            self.found(sender);
            match Answer::read(&message) {
                Some(answer) => answers.push(answer),
                None => self.counts.unusable_answers += 1,
            }
        } else if frame.decode::<Heartbeat>().is_some() {
            self.found(sender);
        }
    }

    fn found(&mut self, sender: Option<std::net::SocketAddr>) {
        if let Some(sender) = sender {
            self.link.adopt(sender);
        }
        if self.last_message.replace(Instant::now()).is_none() {
            self.newly_reachable = true;
            self.notify(Event::Found);
        }
    }

    fn lose(&mut self) {
        if self.last_message.take().is_some() {
            self.notify(Event::Lost);
            self.notify(Event::Waiting(self.address.clone()));
        }
    }

    /// Detects a companion that has become silent.
    pub fn watch(&mut self, now: Instant) {
        if self.last_message.is_some_and(|last| now.saturating_duration_since(last) > SILENCE) {
            self.link.abandon();
            self.lose();
        }
    }

    /// Counts an answer that is used, and reports arming and disarming.
    pub fn use_answer(&mut self, answer: &Answer) {
        self.counts.answers += 1;
        self.counts.limited_answers += u64::from(answer.limited);
        if answer.armed != self.armed {
            self.armed = answer.armed;
            self.notify(if answer.armed { Event::Armed } else { Event::Disarmed });
        }
    }

    /// Ends the session and returns the counts.
    pub fn finish(mut self) -> Summary {
        self.counts.bad_frames = self.parser.bad();
        self.counts.foreign_frames += self.parser.unknown();
        self.counts
    }
}
