//! Types of the numbers in the binary messages of ULog and of ROS.

/// Type of a number in a message.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Number {
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
    /// The type with this name in a ULog or a ROS definition; `None` if the type is not a number.
    pub(crate) fn named(name: &str) -> Option<Number> {
        Some(match name {
            "int8_t" | "int8" => Number::I8,
            "uint8_t" | "uint8" | "bool" | "char" | "byte" => Number::U8,
            "int16_t" | "int16" => Number::I16,
            "uint16_t" | "uint16" => Number::U16,
            "int32_t" | "int32" => Number::I32,
            "uint32_t" | "uint32" => Number::U32,
            "int64_t" | "int64" => Number::I64,
            "uint64_t" | "uint64" => Number::U64,
            "float" | "float32" => Number::F32,
            "double" | "float64" => Number::F64,
            _ => return None,
        })
    }

    /// Size of a number of this type, bytes.
    pub(crate) fn size(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::I64 | Number::U64 | Number::F64 => 8,
        }
    }

    /// The little-endian value at `offset` (bytes); NaN if it extends beyond the end of `bytes`.
    pub(crate) fn at(self, bytes: &[u8], offset: usize) -> f64 {
        fn take<const N: usize>(bytes: &[u8], offset: usize) -> Option<[u8; N]> {
            bytes.get(offset..)?.first_chunk().copied()
        }
        let value = match self {
            Number::I8 => take(bytes, offset).map(|b| f64::from(i8::from_le_bytes(b))),
            Number::U8 => take(bytes, offset).map(|b| f64::from(u8::from_le_bytes(b))),
            Number::I16 => take(bytes, offset).map(|b| f64::from(i16::from_le_bytes(b))),
            Number::U16 => take(bytes, offset).map(|b| f64::from(u16::from_le_bytes(b))),
            Number::I32 => take(bytes, offset).map(|b| f64::from(i32::from_le_bytes(b))),
            Number::U32 => take(bytes, offset).map(|b| f64::from(u32::from_le_bytes(b))),
            Number::I64 => take(bytes, offset).map(|b| i64::from_le_bytes(b) as f64),
            Number::U64 => take(bytes, offset).map(|b| u64::from_le_bytes(b) as f64),
            Number::F32 => take(bytes, offset).map(|b| f64::from(f32::from_le_bytes(b))),
            Number::F64 => take(bytes, offset).map(f64::from_le_bytes),
        };
        value.unwrap_or(f64::NAN)
    }
}
