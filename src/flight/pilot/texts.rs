//! The lines that wait for the ground stations, bounded.

use std::collections::VecDeque;

use greylag_link::autopilot::{Severity, Text};

/// Lines kept at most: an hour without a client must not fill the memory.
const CAPACITY: usize = 32;

/// A queue of lines; the oldest gives way to the newest.
#[derive(Debug, Default)]
pub(super) struct Texts {
    waiting: VecDeque<Text>,
}

impl Texts {
    pub(super) fn say(&mut self, severity: Severity, words: impl Into<String>) {
        if self.waiting.len() == CAPACITY {
            self.waiting.pop_front();
        }
        self.waiting.push_back(Text { severity, words: words.into() });
    }

    pub(super) fn take(&mut self) -> Option<Text> {
        self.waiting.pop_front()
    }
}
