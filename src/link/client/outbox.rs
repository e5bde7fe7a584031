//! A bounded queue of outgoing frames, which the owner of the sockets sends.

use crate::peer::PeerId;

/// Capacity, frames. A caller that drains the queue after every call never fills it.
const CAPACITY: usize = 4096;

/// A bounded queue of frames and their receivers. Frames that do not fit are dropped and counted.
#[derive(Debug, Default)]
pub struct Outbox {
    frames: Vec<(PeerId, Vec<u8>)>,
    dropped: u64,
}

impl Outbox {
    /// Appends a frame, or drops it when the queue is full.
    pub fn push(&mut self, peer: PeerId, frame: Vec<u8>) {
        match self.frames.len() < CAPACITY {
            true => self.frames.push((peer, frame)),
            false => self.dropped += 1,
        }
    }

    /// Removes and returns all frames, oldest first.
    pub fn drain(&mut self) -> impl Iterator<Item = (PeerId, Vec<u8>)> + '_ {
        self.frames.drain(..)
    }

    /// Number of frames dropped because the queue was full.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}
