//! A bounded queue of texts for the ground stations.

use std::collections::VecDeque;

use greylag_link::autopilot::{Severity, Text};

/// Largest number of texts in the queue. It bounds the memory if nobody fetches the texts.
const CAPACITY: usize = 32;

/// A queue of texts. When it is full, the oldest of the least severe texts is dropped.
#[derive(Debug, Default)]
pub(super) struct Texts {
    waiting: VecDeque<Text>,
}

impl Texts {
    pub(super) fn say(&mut self, severity: Severity, words: impl Into<String>) {
        self.waiting.push_back(Text { severity, words: words.into() });
        if self.waiting.len() > CAPACITY {
            // `Severity` is ordered from the most to the least severe
            let least = self.waiting.iter().map(|text| text.severity).max();
            if let Some(at) = self.waiting.iter().position(|text| Some(text.severity) == least) {
                self.waiting.remove(at);
            }
        }
    }

    pub(super) fn take(&mut self) -> Option<Text> {
        self.waiting.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(texts: &mut Texts) -> Vec<String> {
        std::iter::from_fn(|| texts.take()).map(|text| text.words).collect()
    }

    #[test]
    fn a_full_queue_drops_the_oldest_of_the_least_severe_texts() {
        let mut texts = Texts::default();
        texts.say(Severity::Critical, "critical");
        texts.say(Severity::Info, "info");
        (0..CAPACITY).for_each(|i| texts.say(Severity::Warning, format!("warning {i}")));
        let left = taken(&mut texts);
        assert_eq!(left.len(), CAPACITY);
        // The text of least severity was dropped first, then the oldest warning.
        assert_eq!(left[..2], ["critical", "warning 1"]);
        assert_eq!(left[CAPACITY - 1], format!("warning {}", CAPACITY - 1));
    }

    #[test]
    fn a_new_text_displaces_none_that_is_more_severe() {
        let mut texts = Texts::default();
        (0..CAPACITY).for_each(|i| texts.say(Severity::Error, format!("error {i}")));
        texts.say(Severity::Info, "info");
        assert_eq!(taken(&mut texts)[0], "error 0");
    }
}
