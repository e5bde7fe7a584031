//! One client: the version it speaks, its sequence counter, its streams, what it is being sent.

use std::time::Duration;

use super::outbox::Outbox;
use super::streams::StreamTable;
use crate::autopilot::Severity;
use crate::framing::{Frame, Source, Version};
use crate::peer::PeerId;
use crate::wire::Message;
use crate::wire::answer::{self, CommandResult, TEXT_CHUNK};
use crate::wire::request::CommandRequest;

/// After this silence a peer may have been replaced by one that speaks the other version.
const VERSION_MEMORY: Duration = Duration::from_secs(5);
/// A command sent again within this time gets its old answer.
const COMMAND_MEMORY: Duration = Duration::from_secs(3);
/// Warnings that may come at once, with the time that earns one more.
const COMPLAINTS: u32 = 10;
const COMPLAINT_EVERY: Duration = Duration::from_millis(500);
/// Parameters per call, with the time between calls: 200 a second.
const PARAMETERS_AT_ONCE: usize = 2;
const PARAMETERS_EVERY: Duration = Duration::from_millis(10);

/// How long a session lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stay {
    /// While the peer is heard now and then.
    WhileHeard,
    /// Until the peer is forgotten: a connection, or the target of a `udpout:` link.
    UntilForgotten,
}

/// One client.
#[derive(Debug)]
pub struct Session {
    /// Where it is.
    pub peer: PeerId,
    /// How long it stays.
    pub stay: Stay,
    /// When it was last heard (or first met), host clock.
    pub heard: Duration,
    /// Whether it has had its first heartbeat.
    pub greeted: bool,
    /// What it is sent by itself.
    pub streams: StreamTable,
    version: Version,
    /// Whether `version` comes from the peer itself.
    spoken: bool,
    sequence: u8,
    last_command: Option<(CommandRequest, CommandResult, Duration)>,
    complaints: u32,
    next_complaint: Duration,
    listing: Option<usize>,
    next_parameters: Duration,
}

impl Session {
    /// A session that begins now.
    pub fn new(peer: PeerId, stay: Stay, host: Duration) -> Self {
        Session {
            peer,
            stay,
            heard: host,
            greeted: false,
            streams: StreamTable::new(host),
            version: Version::V2,
            spoken: false,
            sequence: 0,
            last_command: None,
            complaints: COMPLAINTS,
            next_complaint: host,
            listing: None,
            next_parameters: host,
        }
    }

    /// Learns from a frame: a peer that has shown MAVLink 2 is answered in it, one that has only
    /// shown MAVLink 1 in that.
    pub fn note_frame(&mut self, host: Duration, frame: &Frame<'_>) {
        let stale = host.saturating_sub(self.heard) > VERSION_MEMORY;
        if !self.spoken || stale || frame.version == Version::V2 {
            self.version = frame.version;
        }
        self.spoken = true;
        self.heard = host;
    }

    /// Sends a message in the peer's version; one that MAVLink 1 has no room for is not sent.
    pub fn send(&mut self, message: &Message, from: Source, outbox: &mut Outbox) {
        self.send_as(self.version, message, from, outbox);
    }

    /// Sends a message in a given version: the handshake to MAVLink 2 needs it.
    pub fn send_as(
        &mut self,
        version: Version,
        message: &Message,
        from: Source,
        outbox: &mut Outbox,
    ) {
        if let Some(frame) = message.encode(version, self.sequence, from) {
            self.sequence = self.sequence.wrapping_add(1);
            outbox.push(self.peer, frame);
        }
    }

    /// Sends a line of any length: in chunks that MAVLink 2 joins, or as lines of their own.
    pub fn say(
        &mut self,
        severity: Severity,
        words: &str,
        id: u16,
        from: Source,
        outbox: &mut Outbox,
    ) {
        let lines = match self.version {
            Version::V2 => answer::texts(severity, words, id),
            Version::V1 => {
                let letters: Vec<char> = words.chars().collect();
                let line =
                    |part: &[char]| answer::texts(severity, &part.iter().collect::<String>(), 0);
                letters.chunks(TEXT_CHUNK).flat_map(line).collect()
            }
        };
        lines.iter().for_each(|line| self.send(line, from, outbox));
    }

    /// Whether one more warning may be sent now.
    pub fn may_complain(&mut self, host: Duration) -> bool {
        let earned =
            host.saturating_sub(self.next_complaint).as_millis() / COMPLAINT_EVERY.as_millis();
        if earned > 0 {
            self.complaints = COMPLAINTS
                .min(self.complaints.saturating_add(earned.min(u128::from(COMPLAINTS)) as u32));
            self.next_complaint = host;
        }
        let allowed = self.complaints > 0;
        self.complaints = self.complaints.saturating_sub(1);
        allowed
    }

    /// The answer that this very command got a moment ago, if it is a retransmission.
    pub fn answered(&self, host: Duration, command: &CommandRequest) -> Option<CommandResult> {
        let (known, result, when) = self.last_command.as_ref()?;
        let same_bits = known.params.map(f64::to_bits) == command.params.map(f64::to_bits);
        let again = command.confirmation > 0 && known.number == command.number && same_bits;
        (again && host.saturating_sub(*when) < COMMAND_MEMORY).then_some(*result)
    }

    /// Remembers a command's answer for its retransmissions.
    pub fn remember(&mut self, host: Duration, command: CommandRequest, result: CommandResult) {
        self.last_command = Some((command, result, host));
    }

    /// Starts sending the whole parameter table.
    pub fn list_parameters(&mut self) {
        self.listing = Some(0);
    }

    /// The indices of the parameters that are due now, of a table of `count`.
    pub fn parameters_due(&mut self, host: Duration, count: usize) -> std::ops::Range<usize> {
        let Some(next) = self.listing.filter(|_| host >= self.next_parameters) else {
            return 0..0;
        };
        let end = count.min(next + PARAMETERS_AT_ONCE);
        self.listing = (end < count).then_some(end);
        self.next_parameters = host + PARAMETERS_EVERY;
        next.min(end)..end
    }
}
