//! The side that serves ground stations and offboard programs, as an autopilot of its own.
//!
//! Free of sockets and clocks: [`Clients::handle`] takes what arrived, [`Clients::poll`] does what
//! is due, [`Clients::drain`] hands over what is to be sent. Work and memory are bounded per call,
//! whatever arrives.

mod commands;
mod counts;
mod due;
mod setpoint_authority;
mod outbox;
mod parameters;
mod session;
mod setpoints;
mod streams;

use std::time::Duration;

use super::autopilot::{Autopilot, Severity, Verdict};
use super::framing::{Frame, FrameCounts, Frames, Source};
use super::peer::PeerId;
use super::vehicle::real::ONBOARD;
use super::wire::Message;
use super::wire::answer::{self, MissionResult};
use super::wire::mode::{self, ModeRequest, Pulse, Role};
use super::wire::request::{self, MissionStep, Recipient, Request};
use super::wire::telemetry::Home;
pub use counts::ClientCounts;
use greylag_physics::Time;
use outbox::Outbox;
use session::{Session, Stay};
use setpoint_authority::SetpointAuthority;
use setpoints::OTHER_SETPOINT;

/// Sessions at most.
pub const MAX_SESSIONS: usize = 32;
/// A session that was silent for this long may be displaced by a new one when all are taken.
const DISPLACEABLE: Duration = Duration::from_secs(3);
/// A datagram peer that was silent for this long is forgotten.
const FORGOTTEN: Duration = Duration::from_secs(60);
/// Lines for the ground stations taken from the autopilot in one call.
const TEXTS_PER_POLL: usize = 8;
/// Letters of a line that are sent: eight chunks.
const TEXT_LENGTH: usize = 400;

/// The two clocks that a client's request meets.
///
/// The host's clock paces heartbeats and streams, which go on when the vehicle stands still; the
/// vehicle's clock drives the autopilot and stamps what is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Now {
    /// Time since the program's start.
    pub host: Duration,
    /// Vehicle time.
    pub vehicle: Time,
}

/// All clients, with what each has asked for.
#[derive(Debug)]
pub struct Clients {
    identity: Source,
    role: Role,
    sessions: Vec<Session>,
    outbox: Outbox,
    pulse: Option<Pulse>,
    next_heartbeat: Duration,
    home: Option<Home>,
    was_armed: bool,
    text_id: u16,
    setpoint_authority: SetpointAuthority,
    stick_authority: SetpointAuthority,
    counts: ClientCounts,
    next_summary: Duration,
    bad_at_summary: u64,
}

impl Clients {
    /// No clients yet; `identity` is who we are to them (system 1, component 1 with the shim).
    pub fn new(identity: Source) -> Self {
        Clients {
            identity,
            role: Role::Autopilot,
            sessions: Vec::with_capacity(MAX_SESSIONS),
            outbox: Outbox::default(),
            pulse: None,
            next_heartbeat: Duration::ZERO,
            home: None,
            was_armed: false,
            text_id: 0,
            setpoint_authority: SetpointAuthority::default(),
            stick_authority: SetpointAuthority::default(),
            counts: ClientCounts::default(),
            next_summary: Duration::ZERO,
            bad_at_summary: 0,
        }
    }

    /// No clients yet; we are the onboard computer of a controller that is not heard yet: only what
    /// is addressed to our component is ours, and nothing is streamed that nobody asked for.
    pub fn onboard() -> Self {
        let identity = Source { system: 1, component: ONBOARD };
        Clients { role: Role::Onboard, ..Clients::new(identity) }
    }

    /// Takes the controller's system id as ours.
    pub fn adopt(&mut self, system: u8) {
        self.identity.system = system;
    }

    /// Who we are.
    pub fn identity(&self) -> Source {
        self.identity
    }

    /// All that are served.
    pub fn peers(&self) -> impl Iterator<Item = PeerId> + '_ {
        self.sessions.iter().map(|session| session.peer)
    }

    /// Serves a peer from now on without waiting for it to speak: the target of a `udpout:` link,
    /// or a TCP connection. It stays until [`Clients::forget`].
    pub fn welcome(&mut self, now: Now, peer: PeerId) {
        match self.sessions.iter().position(|s| s.peer == peer) {
            Some(at) => self.sessions[at].stay = Stay::UntilForgotten,
            None => {
                self.admit(now, peer, Stay::UntilForgotten);
            }
        }
    }

    /// Forgets a peer, as when its connection has closed.
    pub fn forget(&mut self, peer: PeerId) {
        self.sessions.retain(|s| s.peer != peer);
        self.setpoint_authority.release(peer);
        self.stick_authority.release(peer);
    }

    /// Takes one datagram, or some bytes of whole frames, from a peer.
    pub fn handle(&mut self, now: Now, peer: PeerId, bytes: &[u8], autopilot: &mut dyn Autopilot) {
        let mut counts = FrameCounts::default();
        for frame in Frames::new(bytes, &mut counts) {
            self.take(now, peer, &frame, autopilot);
        }
        self.counts.frames.add(counts);
    }

    /// Sends what is due: heartbeats, streams, parameters and lines of text. To be called from
    /// the control task itself, about every 10 ms.
    pub fn poll(&mut self, now: Now, autopilot: &mut dyn Autopilot) {
        self.sessions.retain(|s| {
            s.stay == Stay::UntilForgotten || now.host.saturating_sub(s.heard) < FORGOTTEN
        });
        let status = autopilot.status();
        self.note_home(&status);
        self.beat(now, &status);
        self.stream(now, &status);
        self.list_parameters(now, autopilot.parameters());
        for text in std::iter::from_fn(|| autopilot.take_text()).take(TEXTS_PER_POLL) {
            (0..self.sessions.len()).for_each(|at| self.say(at, text.severity, &text.words));
        }
        self.summarise(now);
    }

    /// Hands over what is to be sent, oldest first: each item is one frame for one peer.
    pub fn drain(&mut self) -> impl Iterator<Item = (PeerId, Vec<u8>)> + '_ {
        self.outbox.drain()
    }

    /// What was received so far.
    pub fn counts(&self) -> ClientCounts {
        ClientCounts { dropped: self.outbox.dropped(), ..self.counts }
    }

    /// How many peers are served.
    pub fn session_count(&self) -> usize {
        self.sessions.len()
    }

    fn take(&mut self, now: Now, peer: PeerId, frame: &Frame<'_>, autopilot: &mut dyn Autopilot) {
        if frame.source == self.identity {
            self.counts.echoes += 1;
            return;
        }
        let known = self.sessions.iter().position(|s| s.peer == peer);
        let Some(at) = known.or_else(|| self.admit(now, peer, Stay::WhileHeard)) else {
            self.counts.turned_away += 1;
            return;
        };
        self.sessions[at].note_frame(now.host, frame);
        match request::read(frame) {
            Some((to, _)) if !self.is_for_us(to) => self.counts.for_others += 1,
            Some((_, request)) => self.serve(now, at, frame.source, request, autopilot),
            None => {}
        }
    }

    /// Opens a session, in the place of the longest silent one when all are taken.
    fn admit(&mut self, now: Now, peer: PeerId, stay: Stay) -> Option<usize> {
        if self.sessions.len() >= MAX_SESSIONS {
            let silent = |s: &Session| now.host.saturating_sub(s.heard);
            let (at, longest) = (0..self.sessions.len())
                .filter(|at| self.sessions[*at].stay == Stay::WhileHeard)
                .map(|at| (at, silent(&self.sessions[at])))
                .max_by_key(|(_, silence)| *silence)?;
            if longest < DISPLACEABLE {
                return None;
            }
            self.sessions.remove(at);
        }
        let mut session = Session::new(peer, stay, now.host);
        if self.role == Role::Onboard {
            // Group 0 is all that is streamed by default.
            session.streams.set_group(0, None, now.host);
        }
        self.sessions.push(session);
        Some(self.sessions.len() - 1)
    }

    fn is_for_us(&self, to: Recipient) -> bool {
        let component = to.component == self.identity.component
            || (to.component == 0 && self.role == Role::Autopilot);
        (to.system == 0 || to.system == self.identity.system) && component
    }

    fn serve(
        &mut self,
        now: Now,
        at: usize,
        from: Source,
        request: Request,
        autopilot: &mut dyn Autopilot,
    ) {
        match request {
            Request::Command(command) => self.command(now, at, from, command, autopilot),
            Request::SetMode { base, custom } => self.set_mode(now, at, base, custom, autopilot),
            Request::Attitude(setpoint) => self.attitude(now, at, setpoint, autopilot),
            Request::Sticks(sticks) => self.sticks(now, at, sticks, autopilot),
            Request::OtherSetpoint => self.refuse_setpoint(now, at, OTHER_SETPOINT),
            Request::ParameterList => self.sessions[at].list_parameters(),
            Request::ParameterRead(key) => {
                self.read_parameter(at, from, key, autopilot.parameters())
            }
            Request::ParameterSet { name, value } => {
                self.set_parameter(now, at, from, name, value, autopilot)
            }
            Request::Mission { step, kind } => self.reply(at, &mission(step, kind, from)),
            // An answer of the other side is not to be answered: 128 is ACK, 129 NAK.
            Request::File { opcode: 128 | 129, .. } => {}
            Request::File { sequence, session, opcode } => {
                self.reply(at, &answer::file_nak(sequence, session, opcode, from));
            }
            Request::TimeSync { theirs } => {
                self.reply(at, &answer::time_sync(theirs, now.vehicle, from))
            }
            Request::Ping { time_usec, sequence } => {
                self.reply(at, &answer::ping(time_usec, sequence, from))
            }
            Request::DataStream { group, rate } => {
                self.sessions[at].streams.set_group(group, rate, now.host)
            }
        }
    }

    /// SET_MODE has no acknowledgement: the heartbeat tells, and a refusal is said in words.
    fn set_mode(
        &mut self,
        now: Now,
        at: usize,
        base: u8,
        custom: u32,
        autopilot: &mut dyn Autopilot,
    ) {
        let verdict = match mode::from_set_mode(base, custom) {
            ModeRequest::Known(mode) => autopilot.set_mode(now.vehicle, mode),
            ModeRequest::Unknown => {
                Verdict::Denied("Mode refused: not a mode of this autopilot".into())
            }
        };
        if let Verdict::Rejected(reason) | Verdict::Denied(reason) = verdict {
            self.complain(now, at, &reason);
        }
    }

    fn reply(&mut self, at: usize, message: &Message) {
        self.sessions[at].send(message, self.identity, &mut self.outbox);
    }

    /// A line for one client.
    fn say(&mut self, at: usize, severity: Severity, words: &str) {
        self.text_id = self.text_id.checked_add(1).unwrap_or(1);
        let words = words.char_indices().nth(TEXT_LENGTH).map_or(words, |(end, _)| &words[..end]);
        self.sessions[at].say(severity, words, self.text_id, self.identity, &mut self.outbox);
    }

    /// A warning for one client, unless it has had too many lately.
    fn complain(&mut self, now: Now, at: usize, words: &str) {
        if self.sessions[at].may_complain(now.host) {
            self.say(at, Severity::Warning, words);
        }
    }
}

/// There are no missions here: nothing to list, nothing to clear, no room for any.
fn mission(step: MissionStep, kind: u8, from: Source) -> Message {
    match step {
        MissionStep::List => answer::empty_mission(kind, from),
        MissionStep::Item => answer::mission_ack(MissionResult::InvalidSequence, kind, from),
        MissionStep::Upload => answer::mission_ack(MissionResult::Unsupported, kind, from),
        MissionStep::Clear => answer::mission_ack(MissionResult::Accepted, kind, from),
    }
}
