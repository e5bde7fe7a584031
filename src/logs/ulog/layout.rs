//! Positions of the fields in a ULog message.

use std::collections::BTreeMap;

/// Nesting of message types; PX4 has three levels at most.
const DEPTH: usize = 8;
/// Numeric fields of one topic; PX4's largest has a few hundred.
const FIELDS: usize = 2048;

/// A type of a field with its size in bytes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
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

impl Kind {
    pub(super) fn named(name: &str) -> Option<Kind> {
        Some(match name {
            "int8_t" => Kind::I8,
            "uint8_t" | "bool" | "char" => Kind::U8,
            "int16_t" => Kind::I16,
            "uint16_t" => Kind::U16,
            "int32_t" => Kind::I32,
            "uint32_t" => Kind::U32,
            "int64_t" => Kind::I64,
            "uint64_t" => Kind::U64,
            "float" => Kind::F32,
            "double" => Kind::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Kind::I8 | Kind::U8 => 1,
            Kind::I16 | Kind::U16 => 2,
            Kind::I32 | Kind::U32 | Kind::F32 => 4,
            Kind::I64 | Kind::U64 | Kind::F64 => 8,
        }
    }

    /// The value at `offset`; NaN beyond the end, where PX4 has cut the padding.
    pub(super) fn at(self, bytes: &[u8], offset: usize) -> f64 {
        fn take<const N: usize>(bytes: &[u8], offset: usize) -> Option<[u8; N]> {
            bytes.get(offset..)?.first_chunk().copied()
        }
        let value = match self {
            Kind::I8 => take(bytes, offset).map(|b| f64::from(i8::from_le_bytes(b))),
            Kind::U8 => take(bytes, offset).map(|b| f64::from(u8::from_le_bytes(b))),
            Kind::I16 => take(bytes, offset).map(|b| f64::from(i16::from_le_bytes(b))),
            Kind::U16 => take(bytes, offset).map(|b| f64::from(u16::from_le_bytes(b))),
            Kind::I32 => take(bytes, offset).map(|b| f64::from(i32::from_le_bytes(b))),
            Kind::U32 => take(bytes, offset).map(|b| f64::from(u32::from_le_bytes(b))),
            Kind::I64 => take(bytes, offset).map(|b| i64::from_le_bytes(b) as f64),
            Kind::U64 => take(bytes, offset).map(|b| u64::from_le_bytes(b) as f64),
            Kind::F32 => take(bytes, offset).map(|b| f64::from(f32::from_le_bytes(b))),
            Kind::F64 => take(bytes, offset).map(f64::from_le_bytes),
        };
        value.unwrap_or(f64::NAN)
    }
}

/// A field of a subscribed topic, flattened.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub name: String,
    pub kind: Kind,
    pub offset: usize,
}

/// Positions of a message's fields.
pub(super) struct Layout {
    /// The fields that are read.
    pub fields: Vec<Field>,
    /// Types and positions of `timestamp` and `timestamp_sample`.
    pub stamp: Option<(Kind, usize)>,
    pub sampled: Option<(Kind, usize)>,
    /// Bytes of a whole record, without the padding at its end, which PX4 does not write.
    pub size: usize,
    /// Bytes of a whole record with that padding.
    pub padded: usize,
}

impl Layout {
    pub(super) fn of(formats: &BTreeMap<String, String>, name: &str) -> Layout {
        let mut fields = Vec::new();
        let mut padded = 0;
        flatten(formats, name, "", DEPTH, &mut padded, &mut fields);
        let find = |n: &str| fields.iter().find(|f| f.name == n).map(|f| (f.kind, f.offset));
        let pads =
            |f: &&Field| f.name.rsplit('.').next().is_some_and(|last| last.starts_with("_padding"));
        let last = fields.iter().rev().find(|f| !pads(f));
        Layout {
            stamp: find("timestamp"),
            sampled: find("timestamp_sample"),
            size: last.map_or(0, |f| f.offset + f.kind.size()),
            padded,
            fields,
        }
    }
}

/// The numeric fields of message `name`, nested ones as `outer.inner`, elements as `field[0]`.
fn flatten(
    formats: &BTreeMap<String, String>,
    name: &str,
    prefix: &str,
    depth: usize,
    offset: &mut usize,
    out: &mut Vec<Field>,
) {
    let (Some(text), Some(depth)) = (formats.get(name), depth.checked_sub(1)) else { return };
    for (kind, field) in text.split(';').filter_map(|f| f.trim().split_once(' ')) {
        let (kind, count) = match kind.split_once('[') {
            None => (kind, None),
            Some((kind, n)) => (kind, n.trim_end_matches(']').parse::<usize>().ok()),
        };
        for i in 0..count.unwrap_or(1) {
            if out.len() >= FIELDS || *offset > usize::from(u16::MAX) {
                return;
            }
            let index = if count.is_some() { format!("[{i}]") } else { String::new() };
            let path = format!("{prefix}{field}{index}");
            match Kind::named(kind) {
                Some(kind) => {
                    out.push(Field { name: path, kind, offset: *offset });
                    *offset += kind.size();
                }
                None => {
                    let before = *offset;
                    flatten(formats, kind, &format!("{path}."), depth, offset, out);
                    // A field of unknown type: the positions of the fields after it are unknown.
                    if *offset == before {
                        return;
                    }
                }
            }
        }
    }
}
