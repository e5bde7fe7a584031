//! MAVLink server through which ground stations and offboard programs (clients) use an autopilot.
//!
//! The server has no sockets and no clock: its caller passes received bytes and the time. See [`Clients`] for the order of
//! calls.

mod commands;
mod counts;
mod due;
mod setpoint_authority;
mod outbox;
mod parameters;
mod refusals;
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
use refusals::Refusals;
use session::{Session, Stay};
use setpoint_authority::SetpointAuthority;
use setpoints::OTHER_SETPOINT;

/// Largest number of simultaneous sessions.
pub const MAX_SESSIONS: usize = 32;
/// While all sessions are in use, a new peer may replace a session whose peer has been silent for this time.
const DISPLACEABLE: Duration = Duration::from_secs(3);
/// Time without frames after which the session of a peer without a connection (UDP) ends.
const FORGOTTEN: Duration = Duration::from_secs(60);
/// Largest number of texts fetched from the autopilot per call of `poll`.
const TEXTS_PER_POLL: usize = 8;
/// Longest text that is sent, in characters: eight chunks of 50.
const TEXT_LENGTH: usize = 400;
/// Ending of a text that was shortened. STATUSTEXT allows ASCII only.
const CUT: &str = "...";

/// Host time and vehicle time at a call.
///
/// Heartbeats and streams are paced by host time, so that they continue if the vehicle's clock stops. Vehicle time is passed to
/// the autopilot and written into the messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Now {
    /// Time since the program's start, monotonic.
    pub host: Duration,
    /// Time of the vehicle's clock, which may stop or restart.
    pub vehicle: Time,
}

/// Sessions with all MAVLink clients of an autopilot.
///
/// Kinds of methods:
///
/// - input: [`Clients::handle`] takes received bytes, [`Clients::welcome`] and [`Clients::forget`] take connections
///   that open and close;
/// - time: [`Clients::poll`] queues the frames that are due;
/// - output: [`Clients::drain`] returns the queued frames;
/// - queries: [`Clients::peers`], [`Clients::counts`], [`Clients::session_count`], [`Clients::identity`].
///
/// Order of calls: after any input, and after `poll` about every 10 ms, call `drain` and send its frames. The queue of
/// frames is bounded; further frames are dropped and counted. `handle` and `poll` call the [`Autopilot`] synchronously.
///
/// [`Now::host`] must not decrease between calls. [`Now::vehicle`] may stop, and may restart with the vehicle.
///
/// Work and memory per call are bounded for any input.
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
    refusals: Refusals,
}

impl Clients {
    /// A server without sessions. `identity` is the sender of its messages. In flights with the simulator it is system 1,
    /// component 1.
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
            refusals: Refusals::default(),
        }
    }

    /// A server for an onboard computer beside a flight controller whose system id is not known yet. The server answers only
    /// requests that are addressed to its component, and sends streams only on request.
    pub fn onboard() -> Self {
        let identity = Source { system: 1, component: ONBOARD };
        Clients { role: Role::Onboard, ..Clients::new(identity) }
    }

    /// Sets the system id of the server's messages to `system`, the flight controller's.
    pub fn adopt(&mut self, system: u8) {
        self.identity.system = system;
    }

    /// System and component id of the server's messages.
    pub fn identity(&self) -> Source {
        self.identity
    }

    /// Peers with a session.
    pub fn peers(&self) -> impl Iterator<Item = PeerId> + '_ {
        self.sessions.iter().map(|session| session.peer)
    }

    /// Opens a session before the peer has sent anything: for the target of a `udpout:` link, or for a TCP connection. The
    /// session lasts until [`Clients::forget`].
    pub fn welcome(&mut self, now: Now, peer: PeerId) {
        match self.sessions.iter().position(|s| s.peer == peer) {
            Some(at) => self.sessions[at].stay = Stay::UntilForgotten,
            None => {
                self.admit(now, peer, Stay::UntilForgotten);
            }
        }
    }

    /// Ends the session of `peer`, for instance when its connection is closed.
    pub fn forget(&mut self, peer: PeerId) {
        self.sessions.retain(|s| s.peer != peer);
        self.setpoint_authority.release(peer);
        self.stick_authority.release(peer);
    }

    /// Handles `bytes` from `peer`: one datagram, or complete frames of a byte stream.
    pub fn handle(&mut self, now: Now, peer: PeerId, bytes: &[u8], autopilot: &mut dyn Autopilot) {
        let mut counts = FrameCounts::default();
        for frame in Frames::new(bytes, &mut counts) {
            self.take(now, peer, &frame, autopilot);
        }
        self.counts.frames.add(counts);
    }

    /// Ends the sessions of silent peers, and queues the frames that are due: heartbeats, streams, parameters and texts. To be
    /// called about every 10 ms.
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

    /// Removes and returns the queued frames, oldest first, each with its peer.
    pub fn drain(&mut self) -> impl Iterator<Item = (PeerId, Vec<u8>)> + '_ {
        self.outbox.drain()
    }

    /// Counters of received frames and of dropped messages.
    pub fn counts(&self) -> ClientCounts {
        ClientCounts { dropped: self.outbox.dropped(), ..self.counts }
    }

    /// Number of sessions.
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

    /// Opens a session for `peer` and returns its index. If all sessions are in use, the new session replaces the one whose peer
    /// has been silent longest; `None` if no session may be replaced.
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
            // group 0 contains all streams that are on by default; they are turned off
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
            // opcodes 128 (ACK) and 129 (NAK) are replies and are not answered
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

    /// Handles SET_MODE, which has no acknowledgement in MAVLink. The client sees the new mode in the heartbeat. A refusal is
    /// sent as a text.
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

    /// Queues a text for the client of the session with index `at`.
    fn say(&mut self, at: usize, severity: Severity, words: &str) {
        self.text_id = self.text_id.checked_add(1).unwrap_or(1);
        let cut = (words.chars().count() > TEXT_LENGTH)
            .then(|| words.chars().take(TEXT_LENGTH - CUT.len()).collect::<String>() + CUT);
        let words = cut.as_deref().unwrap_or(words);
        self.sessions[at].say(severity, words, self.text_id, self.identity, &mut self.outbox);
    }

    /// Queues a warning for the client of the session with index `at`, unless it has had too many recently. The first warning
    /// of each kind is also logged.
    fn complain(&mut self, now: Now, at: usize, words: &str) {
        self.refusals.log(words);
        if self.sessions[at].may_complain(now.host) {
            self.say(at, Severity::Warning, words);
        }
    }
}

/// Reply to a mission message. Missions are not supported: the list is empty and uploads are refused.
fn mission(step: MissionStep, kind: u8, from: Source) -> Message {
    match step {
        MissionStep::List => answer::empty_mission(kind, from),
        MissionStep::Item => answer::mission_ack(MissionResult::InvalidSequence, kind, from),
        MissionStep::Upload => answer::mission_ack(MissionResult::Unsupported, kind, from),
        MissionStep::Clear => answer::mission_ack(MissionResult::Accepted, kind, from),
    }
}
