//! A buffered window on a file. With it, binary logs are read record by record and are never held in memory completely.

use std::io::{self, Read};

/// Number of bytes read at a time.
const CHUNK: usize = 256 * 1024;

/// A buffered view of the next bytes of a source.
pub(super) struct Window<'a> {
    source: &'a mut dyn Read,
    bytes: Vec<u8>,
    from: usize,
    ended: bool,
    /// The error that ended the reading; `None` without an error.
    failed: Option<io::Error>,
}

impl<'a> Window<'a> {
    /// A window at the beginning of `source`.
    pub fn new(source: &'a mut dyn Read) -> Self {
        Window { source, bytes: Vec::new(), from: 0, ended: false, failed: None }
    }

    /// Returns the next bytes of the source: at least `wanted` bytes, or fewer at the end of the source.
    pub fn view(&mut self, wanted: usize) -> &[u8] {
        if self.bytes.len() - self.from < wanted && !self.ended {
            self.fill(wanted);
        }
        &self.bytes[self.from..]
    }

    /// Advances by `count` bytes of the last view.
    pub fn skip(&mut self, count: usize) {
        self.from = (self.from + count).min(self.bytes.len());
    }

    /// The error that ended the reading, if one did.
    pub fn failure(self) -> Option<io::Error> {
        self.failed
    }

    fn fill(&mut self, wanted: usize) {
        self.bytes.drain(..self.from);
        self.from = 0;
        while self.bytes.len() < wanted && !self.ended {
            let before = self.bytes.len();
            self.bytes.resize(before + CHUNK, 0);
            let got = match self.source.read(&mut self.bytes[before..]) {
                Ok(got) => got,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {
                    self.bytes.truncate(before);
                    continue;
                }
                Err(error) => {
                    self.failed = Some(error);
                    0
                }
            };
            self.bytes.truncate(before + got);
            self.ended = got == 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A source that gives one byte at a time.
    struct Drip(Vec<u8>);

    impl Read for Drip {
        fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
            if self.0.is_empty() {
                return Ok(0);
            }
            to[0] = self.0.remove(0);
            Ok(1)
        }
    }

    #[test]
    fn every_byte_is_seen_once_and_in_order() {
        let all: Vec<u8> = (0..200).collect();
        let mut source = Drip(all.clone());
        let mut window = Window::new(&mut source);
        let mut seen = Vec::new();
        loop {
            let view = window.view(7);
            let take = view.len().min(3);
            if take == 0 {
                break;
            }
            seen.extend_from_slice(&view[..take]);
            window.skip(take);
        }
        assert_eq!(seen, all);
        assert!(window.failure().is_none());
    }
}
