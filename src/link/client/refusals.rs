//! The refusals of clients' requests in the program's log, each kind once.

/// Largest number of kinds that are logged, a bound on the memory.
const KINDS: usize = 64;

/// The kinds of refusals that were logged.
#[derive(Debug, Default)]
pub struct Refusals {
    logged: Vec<String>,
}

impl Refusals {
    /// Logs the refusal `words` unless one of its kind was logged before.
    pub fn log(&mut self, words: &str) {
        if self.is_new(words) {
            tracing::warn!("status text to a client: {words}");
        }
    }

    /// Whether no refusal of the kind of `words` was seen before. Refusals of one kind differ in their digits only.
    fn is_new(&mut self, words: &str) -> bool {
        let same = |known: &String| {
            let letters = words.chars().filter(|c| !c.is_ascii_digit());
            known.chars().eq(letters)
        };
        if self.logged.len() >= KINDS || self.logged.iter().any(same) {
            return false;
        }
        self.logged.push(words.chars().filter(|c| !c.is_ascii_digit()).collect());
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_is_new_once() {
        let mut refusals = Refusals::default();
        assert!(refusals.is_new("OFFBOARD refused: arm first"));
        assert!(!refusals.is_new("OFFBOARD refused: arm first"));
        assert!(refusals.is_new("Arming refused: 7 m/s"));
        assert!(!refusals.is_new("Arming refused: 12 m/s"));
        for k in 0..2 * KINDS {
            refusals.is_new(&"x".repeat(k));
        }
        assert_eq!(refusals.logged.len(), KINDS);
    }
}
