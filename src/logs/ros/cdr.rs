//! Reads the numbers of a message in the Common Data Representation (CDR) of DDS, in either byte order.
//!
//! A message begins with four bytes that name its encoding. After them, each number is aligned to a multiple of its
//! size. In the second version of the encoding the alignment is four bytes at most.

use crate::number::Number;

/// A message, and the position up to which it is read.
pub(super) struct Cdr<'b> {
    body: &'b [u8],
    at: usize,
    little: bool,
    /// The widest alignment, bytes.
    widest: usize,
}

impl<'b> Cdr<'b> {
    /// Begins to read a message; `None` if its encoding is not plain CDR.
    pub fn of(message: &'b [u8]) -> Option<Cdr<'b>> {
        let (head, body) = message.split_at_checked(4)?;
        let (little, widest) = match head {
            [0, 0, ..] => (false, 8),
            [0, 1, ..] => (true, 8),
            [0, 6, ..] => (false, 4),
            [0, 7, ..] => (true, 4),
            _ => return None,
        };
        Some(Cdr { body, at: 0, little, widest })
    }

    /// Number of bytes that are left.
    pub fn left(&self) -> usize {
        self.body.len() - self.at
    }

    /// The bytes of the next `count` numbers, each of `size` bytes.
    fn take(&mut self, size: usize, count: usize) -> Option<&'b [u8]> {
        let from = self.at.next_multiple_of(size.min(self.widest));
        let to = size.checked_mul(count)?.checked_add(from)?;
        let bytes = self.body.get(from..to)?;
        self.at = to;
        Some(bytes)
    }

    /// The next number; `None` if the message ends before it.
    pub fn number(&mut self, kind: Number) -> Option<f64> {
        let bytes = self.take(kind.size(), 1)?;
        if self.little {
            return Some(kind.at(bytes, 0));
        }
        let mut turned = [0; 8];
        let turned = &mut turned[..bytes.len()];
        turned.copy_from_slice(bytes);
        turned.reverse();
        Some(kind.at(turned, 0))
    }

    /// The number of elements of a sequence.
    pub fn length(&mut self) -> Option<usize> {
        self.number(Number::U32).map(|length| length as usize)
    }

    /// Skips `count` numbers.
    pub fn pass(&mut self, kind: Number, count: usize) -> Option<()> {
        match count {
            // An empty sequence is not aligned.
            0 => Some(()),
            _ => self.take(kind.size(), count).map(|_| ()),
        }
    }

    /// Skips a string.
    pub fn pass_text(&mut self) -> Option<()> {
        let length = self.length()?;
        self.take(1, length).map(|_| ())
    }
}
