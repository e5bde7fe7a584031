//! Session of one client (a ground station or an offboard program): MAVLink version, sequence number, streams and parameter
//! transfer.

use std::time::Duration;

use super::outbox::Outbox;
use super::streams::StreamTable;
use crate::autopilot::Severity;
use crate::framing::{Frame, Source, Version};
use crate::peer::PeerId;
use crate::wire::Message;
use crate::wire::answer::{self, CommandResult, TEXT_CHUNK};
use crate::wire::request::CommandRequest;

/// Time without frames from a peer after which its MAVLink version is determined again, because another program may be using its
/// address by then.
const VERSION_MEMORY: Duration = Duration::from_secs(5);
/// Time after a command within which the same command counts as a retransmission.
const COMMAND_MEMORY: Duration = Duration::from_secs(3);
/// Largest number of warnings to one peer without a pause, and the time after which one more warning is allowed.
const COMPLAINTS: u32 = 10;
const COMPLAINT_EVERY: Duration = Duration::from_millis(500);
/// Number of parameters that are sent at once, and the time to the next ones. The rate is 200 parameters per second.
const PARAMETERS_AT_ONCE: usize = 2;
const PARAMETERS_EVERY: Duration = Duration::from_millis(10);

/// Lifetime of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stay {
    /// The session ends after a timeout without frames from the peer.
    WhileHeard,
    /// The session lasts until the peer is removed. This applies to peers that are connected by TCP or a serial port, and to the
    /// target of a `udpout:` link.
    UntilForgotten,
}

/// Session state of one client.
#[derive(Debug)]
pub struct Session {
    /// Link and address of the peer.
    pub peer: PeerId,
    /// Lifetime of the session.
    pub stay: Stay,
    /// Time of the last frame, or of the session's start, host clock.
    pub heard: Duration,
    /// Whether the first heartbeat was sent to the peer.
    pub greeted: bool,
    /// Message intervals of the peer's streams.
    pub streams: StreamTable,
    version: Version,
    /// Whether `version` was determined from a frame of the peer.
    spoken: bool,
    sequence: u8,
    last_command: Option<(CommandRequest, CommandResult, Duration)>,
    complaints: u32,
    next_complaint: Duration,
    listing: Option<usize>,
    next_parameters: Duration,
}

impl Session {
    /// A session that starts at `host`.
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

    /// Notes a received frame and the MAVLink version of the peer. A peer that has sent MAVLink 2 gets MAVLink 2. A peer that
    /// has only sent MAVLink 1 gets MAVLink 1.
    pub fn note_frame(&mut self, host: Duration, frame: &Frame<'_>) {
        let stale = host.saturating_sub(self.heard) > VERSION_MEMORY;
        if !self.spoken || stale || frame.version == Version::V2 {
            self.version = frame.version;
        }
        self.spoken = true;
        self.heard = host;
    }

    /// Sends a message in the peer's version. To a MAVLink 1 peer, a message with an id above 255 is dropped.
    pub fn send(&mut self, message: &Message, from: Source, outbox: &mut Outbox) {
        self.send_as(self.version, message, from, outbox);
    }

    /// Sends a message in the version `version`, as the MAVLink 2 handshake requires.
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

    /// Sends a text of any length in chunks. A MAVLink 2 receiver joins the chunks of the text `id`. For MAVLink 1 each chunk is
    /// a text of its own.
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

    /// Whether the rate limit allows one more warning. If so, the warning is counted.
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

    /// If `command` is a retransmission, returns the result that was sent before; otherwise `None`. A retransmission has a larger
    /// confirmation than the command that was carried out. MAVROS begins with 1, so that a new request has 1 again.
    pub fn answered(&self, host: Duration, command: &CommandRequest) -> Option<CommandResult> {
        let (known, result, when) = self.last_command.as_ref()?;
        let same_bits = known.params.map(f64::to_bits) == command.params.map(f64::to_bits);
        let later = command.confirmation > known.confirmation;
        let again = later && known.number == command.number && same_bits;
        (again && host.saturating_sub(*when) < COMMAND_MEMORY).then_some(*result)
    }

    /// Stores the result of a command, in case the command is retransmitted.
    pub fn remember(&mut self, host: Duration, command: CommandRequest, result: CommandResult) {
        self.last_command = Some((command, result, host));
    }

    /// Starts the transfer of the whole parameter table.
    pub fn list_parameters(&mut self) {
        self.listing = Some(0);
    }

    /// Indices of the parameters that are to be sent now, from a table of `count` parameters. They then count as sent.
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
