//! Positions of the fields in a ULog message, from the message formats in the log's header.

use std::collections::BTreeMap;

use crate::number::Number;

/// Largest nesting of message types that is followed. PX4 has three levels at most.
const DEPTH: usize = 8;
/// Largest number of numeric fields of a topic. PX4's largest topic has a few hundred.
const FIELDS: usize = 2048;

/// A field of a subscribed topic, flattened.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub name: String,
    pub kind: Number,
    pub offset: usize,
}

/// Positions of a message's fields.
pub(super) struct Layout {
    /// The fields that are read.
    pub fields: Vec<Field>,
    /// Types and positions of `timestamp` and `timestamp_sample`.
    pub stamp: Option<(Number, usize)>,
    pub sampled: Option<(Number, usize)>,
    /// Length of a record in bytes, without the padding at its end. PX4 does not write this padding.
    pub size: usize,
    /// Length of a record in bytes, with this padding.
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

/// Appends the numeric fields of message `name` to `out`. Nested fields are named `outer.inner`, array elements
/// `field[0]`.
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
            match Number::named(kind) {
                Some(kind) => {
                    out.push(Field { name: path, kind, offset: *offset });
                    *offset += kind.size();
                }
                None => {
                    let before = *offset;
                    flatten(formats, kind, &format!("{path}."), depth, offset, out);
                    // The field has an unknown type, so the positions of the fields after it are unknown.
                    if *offset == before {
                        return;
                    }
                }
            }
        }
    }
}
