//! Reads the fields of a payload by their byte offset. This is for messages that must not be rejected because of an unknown
//! enumeration value.

/// A payload. Bytes beyond its end read as zeros, because MAVLink 2 truncates trailing zero bytes.
#[derive(Clone, Copy)]
pub struct Fields<'a>(pub &'a [u8]);

impl Fields<'_> {
    /// Reads `N` bytes from `offset` on.
    pub fn bytes<const N: usize>(self, offset: usize) -> [u8; N] {
        std::array::from_fn(|i| self.0.get(offset + i).copied().unwrap_or(0))
    }
    /// Reads an unsigned byte.
    pub fn u8(self, offset: usize) -> u8 {
        self.bytes::<1>(offset)[0]
    }
    /// Reads a little-endian 16-bit number.
    pub fn u16(self, offset: usize) -> u16 {
        u16::from_le_bytes(self.bytes(offset))
    }
    /// Reads a little-endian 32-bit number.
    pub fn u32(self, offset: usize) -> u32 {
        u32::from_le_bytes(self.bytes(offset))
    }
    /// Reads a little-endian 64-bit number.
    pub fn u64(self, offset: usize) -> u64 {
        u64::from_le_bytes(self.bytes(offset))
    }
    /// Reads a little-endian signed 32-bit number.
    pub fn i32(self, offset: usize) -> i32 {
        i32::from_le_bytes(self.bytes(offset))
    }
    /// Reads a little-endian 32-bit float.
    pub fn f32(self, offset: usize) -> f32 {
        f32::from_le_bytes(self.bytes(offset))
    }
}
