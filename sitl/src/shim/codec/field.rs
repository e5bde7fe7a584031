//! Writes and reads numbers in MAVLink payloads: little-endian, packed.

/// A payload that is being written, never longer than 255 bytes.
#[derive(Debug)]
pub struct Writer {
    bytes: [u8; 255],
    length: usize,
}

impl Default for Writer {
    fn default() -> Self {
        Writer { bytes: [0; 255], length: 0 }
    }
}

impl Writer {
    fn put(&mut self, bytes: &[u8]) {
        let end = (self.length + bytes.len()).min(self.bytes.len());
        let taken = end - self.length;
        self.bytes[self.length..end].copy_from_slice(&bytes[..taken]);
        self.length = end;
    }

    /// The payload without its trailing zeros; at least one byte remains, as MAVLink 2 requires.
    pub fn truncated(&self) -> &[u8] {
        let written = &self.bytes[..self.length];
        let kept = written.iter().rposition(|&byte| byte != 0).map_or(1, |last| last + 1);
        &self.bytes[..kept]
    }
}

/// A payload that is being read; bytes beyond its end read as zero.
#[derive(Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// Reads from the start of `payload`.
    pub fn new(payload: &'a [u8]) -> Self {
        Reader { rest: payload }
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        let present = self.rest.len().min(N);
        let mut bytes = [0; N];
        bytes[..present].copy_from_slice(&self.rest[..present]);
        self.rest = &self.rest[present..];
        bytes
    }
}

/// A type that can be a field of a message.
pub trait Field: Sized {
    /// Bytes on the wire.
    const SIZE: usize;
    /// Appends the value in little-endian order.
    fn put(&self, writer: &mut Writer);
    /// Reads a value from the front and advances the reader.
    fn take(reader: &mut Reader<'_>) -> Self;
}

macro_rules! numbers {
    ($($number:ty),*) => {$(
        impl Field for $number {
            const SIZE: usize = size_of::<$number>();
            fn put(&self, writer: &mut Writer) {
                writer.put(&self.to_le_bytes());
            }
            fn take(reader: &mut Reader<'_>) -> Self {
                <$number>::from_le_bytes(reader.take())
            }
        }
    )*};
}

numbers!(u8, i8, u16, i16, u32, i32, u64, i64, f32);

impl<T: Field, const N: usize> Field for [T; N] {
    const SIZE: usize = N * T::SIZE;
    fn put(&self, writer: &mut Writer) {
        self.iter().for_each(|element| element.put(writer));
    }
    fn take(reader: &mut Reader<'_>) -> Self {
        std::array::from_fn(|_| T::take(reader))
    }
}
