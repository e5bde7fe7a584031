//! Frames waiting to be fetched by whoever owns the sockets.

use crate::peer::PeerId;

/// Frames held at most; a caller that drains after every call stays far below.
const CAPACITY: usize = 4096;

/// A bounded queue: what does not fit is dropped and counted.
#[derive(Debug, Default)]
pub struct Outbox {
    frames: Vec<(PeerId, Vec<u8>)>,
    dropped: u64,
}

impl Outbox {
    /// Adds a frame.
    pub fn push(&mut self, peer: PeerId, frame: Vec<u8>) {
        match self.frames.len() < CAPACITY {
            true => self.frames.push((peer, frame)),
            false => self.dropped += 1,
        }
    }

    /// Takes everything out, oldest first.
    pub fn drain(&mut self) -> impl Iterator<Item = (PeerId, Vec<u8>)> + '_ {
        self.frames.drain(..)
    }

    /// Frames that did not fit.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }
}
