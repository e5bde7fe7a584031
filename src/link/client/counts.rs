//! Counters of the MAVLink frames from clients (ground stations and scripts), with a summary in the program's log.

use std::time::Duration;

use super::{Clients, Now};
use crate::framing::FrameCounts;

/// Shortest interval between two summaries in the log.
const SUMMARY: Duration = Duration::from_secs(10);

/// Counters of the messages from clients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClientCounts {
    /// MAVLink frames, valid and invalid.
    pub frames: FrameCounts,
    /// Frames with the ids of this program itself.
    pub echoes: u64,
    /// Requests that are addressed to another system or component.
    pub for_others: u64,
    /// Frames from new peers that got no session, because all sessions were in use.
    pub turned_away: u64,
    /// Setpoints and stick positions that were invalid or of an unsupported kind.
    pub refused_setpoints: u64,
    /// Setpoints and stick positions from a peer while another peer has control authority.
    pub contested_setpoints: u64,
    /// Commands with an unsupported number.
    pub unknown_commands: u64,
    /// Outgoing messages that were dropped because the queue was full.
    pub dropped: u64,
}

impl Clients {
    /// Logs one line if further unusable input has arrived since the last line, at most every 10 s.
    pub(super) fn summarise(&mut self, now: Now) {
        let c = self.counts;
        let bad = c.frames.bad() + c.refused_setpoints + c.contested_setpoints + c.turned_away;
        if now.host < self.next_summary || bad == self.bad_at_summary {
            return;
        }
        (self.next_summary, self.bad_at_summary) = (now.host + SUMMARY, bad);
        tracing::warn!(
            bad_crc = c.frames.bad_crc,
            truncated = c.frames.truncated,
            unknown_messages = c.frames.unknown,
            refused_frames = c.frames.refused,
            refused_setpoints = c.refused_setpoints,
            contested_setpoints = c.contested_setpoints,
            turned_away = c.turned_away,
            "input from clients that could not be used, since the start"
        );
    }
}
