//! What clients sent, counted, with a word about it in the program's log now and then.

use std::time::Duration;

use super::{Clients, Now};
use crate::framing::FrameCounts;

/// Between lines in the program's own log about what could not be used.
const SUMMARY: Duration = Duration::from_secs(10);

/// What clients sent, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClientCounts {
    /// Frames of MAVLink.
    pub frames: FrameCounts,
    /// Frames that carried our own ids.
    pub echoes: u64,
    /// Requests for another system or component.
    pub for_others: u64,
    /// Frames from new peers while all sessions were taken.
    pub turned_away: u64,
    /// Setpoints and stick positions that were garbage or of a kind that is not flown.
    pub refused_setpoints: u64,
    /// Setpoints and stick positions from a peer while another one has control authority.
    pub contested_setpoints: u64,
    /// Commands with a number that is not known here.
    pub unknown_commands: u64,
    /// Messages dropped because nobody fetched them.
    pub dropped: u64,
}

impl Clients {
    /// One line in the program's log when something could not be used, at a bounded rate.
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
