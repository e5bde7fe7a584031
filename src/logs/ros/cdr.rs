//! Numbers of a message in the Common Data Representation of DDS (CDR), of either byte order.
//!
//! A message begins with four bytes that name its encoding. A number stands at a multiple of its size behind them, in
//! the second version of the encoding at a multiple of four at most.

/// A number of a message.
#[derive(Clone, Copy, Debug)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    /// The number of a type as a definition writes it.
    pub fn named(name: &str) -> Option<Number> {
        Some(match name {
            "int8" => Number::I8,
            "uint8" | "bool" | "byte" | "char" => Number::U8,
            "int16" => Number::I16,
            "uint16" => Number::U16,
            "int32" => Number::I32,
            "uint32" => Number::U32,
            "int64" => Number::I64,
            "uint64" => Number::U64,
            "float32" => Number::F32,
            "float64" => Number::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::I64 | Number::U64 | Number::F64 => 8,
        }
    }
}

/// A message that is read from its beginning.
pub(super) struct Cdr<'b> {
    body: &'b [u8],
    at: usize,
    little: bool,
    /// The widest alignment.
    widest: usize,
}

impl<'b> Cdr<'b> {
    /// The content of a message; `None` in another encoding than plain CDR.
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

    /// The next `count` bytes, of numbers of `size` bytes.
    fn take(&mut self, size: usize, count: usize) -> Option<&'b [u8]> {
        let from = self.at.next_multiple_of(size.min(self.widest));
        let to = size.checked_mul(count)?.checked_add(from)?;
        let bytes = self.body.get(from..to)?;
        self.at = to;
        Some(bytes)
    }

    /// The bytes of one number, least significant first.
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let little = self.little;
        let mut bytes: [u8; N] = *self.take(N, 1)?.first_chunk()?;
        if !little {
            bytes.reverse();
        }
        Some(bytes)
    }

    /// The next number.
    pub fn number(&mut self, kind: Number) -> Option<f64> {
        Some(match kind {
            Number::I8 => f64::from(i8::from_le_bytes(self.bytes()?)),
            Number::U8 => f64::from(u8::from_le_bytes(self.bytes()?)),
            Number::I16 => f64::from(i16::from_le_bytes(self.bytes()?)),
            Number::U16 => f64::from(u16::from_le_bytes(self.bytes()?)),
            Number::I32 => f64::from(i32::from_le_bytes(self.bytes()?)),
            Number::U32 => f64::from(u32::from_le_bytes(self.bytes()?)),
            Number::I64 => i64::from_le_bytes(self.bytes()?) as f64,
            Number::U64 => u64::from_le_bytes(self.bytes()?) as f64,
            Number::F32 => f64::from(f32::from_le_bytes(self.bytes()?)),
            Number::F64 => f64::from_le_bytes(self.bytes()?),
        })
    }

    /// The number of elements of a sequence.
    pub fn length(&mut self) -> Option<usize> {
        usize::try_from(u32::from_le_bytes(self.bytes()?)).ok()
    }

    /// Passes over `count` numbers.
    pub fn pass(&mut self, kind: Number, count: usize) -> Option<()> {
        match count {
            // An empty sequence is not aligned.
            0 => Some(()),
            _ => self.take(kind.size(), count).map(|_| ()),
        }
    }

    /// Passes over a string.
    pub fn pass_text(&mut self) -> Option<()> {
        let length = self.length()?;
        self.take(1, length).map(|_| ())
    }
}
