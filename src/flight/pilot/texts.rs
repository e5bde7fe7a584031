//! A bounded queue of texts for the ground stations.

use std::collections::VecDeque;

use greylag_link::autopilot::{Severity, Text};

/// Capacity in texts. It bounds the memory if nobody fetches the texts.
const CAPACITY: usize = 32;

/// A queue of texts. When it is full, the oldest text is dropped.
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
