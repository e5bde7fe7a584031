//! PX4 ULog read into topics.
//!
//! Written here because the crates fall short (versions looked at: `px4-ulog` 0.6.1, `yule_log`
//! 0.4.0). `px4-ulog` stops at the first inconsistent record, refuses a second registration of a
//! message number, panics by design where a value's type changes, and decodes every field of every
//! topic; `yule_log` brings a logger and a regular-expression engine along. Neither skips topics
//! that nobody asked for. The independent check is pyulog (`tests/logs_crosscheck.py`).
//!
//! Not read: logged strings, appended-data offsets beyond what follows in file order, defaults of
//! parameters. Parameter changes in flight overwrite the value.

use std::collections::{BTreeMap, HashMap};
use std::io::Read;
use std::rc::Rc;

use super::finding::Finding;
use super::format::ULOG_MAGIC;
use super::topics::{Topic, Topics};
use super::window::Window;

/// Magic, version and start time.
const HEADER: usize = 16;
/// Nesting of message types; PX4 has three levels at most.
const DEPTH: usize = 8;
/// Numeric fields of one topic; PX4's largest has a few hundred.
const FIELDS: usize = 2048;
/// Size and kind of a record.
const RECORD: usize = 3;
/// The longest record with the header of the next one.
const LONGEST: usize = RECORD + u16::MAX as usize + RECORD;
/// Records in a row that show the place where a damaged file goes on.
const IN_STEP: usize = 3;
/// The kinds of records.
const KINDS: &[u8] = b"BFIMPQARDCLSO";

/// A type of a field with its size in bytes.
#[derive(Clone, Copy, Debug)]
enum Kind {
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
    fn named(name: &str) -> Option<Kind> {
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
    fn at(self, bytes: &[u8], offset: usize) -> f64 {
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
struct Field {
    name: String,
    kind: Kind,
    offset: usize,
}

/// Where the fields of a message stand.
struct Layout {
    fields: Vec<Field>,
    /// Where `timestamp` and `timestamp_sample` stand.
    stamp: Option<(Kind, usize)>,
    sampled: Option<(Kind, usize)>,
    /// Bytes of a whole record, without the padding at its end, which PX4 does not write.
    size: usize,
    /// The same with that padding.
    padded: usize,
}

impl Layout {
    fn of(formats: &BTreeMap<String, String>, name: &str) -> Layout {
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

/// A message number's topic.
struct Subscription {
    key: (String, u16),
    layout: Rc<Layout>,
    /// Whether the topic was asked for.
    wanted: bool,
    /// Its records, from the first one on.
    topic: Option<Topic>,
    count: usize,
}

#[derive(Default)]
struct Reader {
    formats: BTreeMap<String, String>,
    /// One for each topic, however often it is subscribed to.
    layouts: BTreeMap<String, Rc<Layout>>,
    subscriptions: HashMap<u16, Subscription>,
    out: Topics,
    dropout_ms: u64,
    dropouts: usize,
    orphans: usize,
    bad_fields: usize,
    short: usize,
    /// Whether the last bytes were a record.
    in_step: bool,
    /// Bytes that belong to no record.
    skipped: usize,
    /// Seconds lost at each damaged place; NaN until the file goes on.
    holes: Vec<f64>,
    /// Time of the last data, s.
    last_s: f64,
}

/// What stands at a place of the file.
enum Place {
    /// A record of so many bytes, its header included.
    Record(usize),
    /// A record that the file's end cuts.
    Cut,
    /// Nothing that belongs there.
    Damage,
}

/// Reads what `wanted` names; everything else is counted.
pub(super) fn read<'a>(
    source: &'a mut dyn Read,
    wanted: &dyn Fn(&str) -> bool,
) -> (Topics, Window<'a>) {
    let mut window = Window::new(source);
    let mut reader = Reader::default();
    let header = window.view(HEADER);
    if !header.starts_with(&ULOG_MAGIC) || header.len() < HEADER {
        reader.out.findings.push(Finding::warning("the file ends within its header"));
        return (reader.out, window);
    }
    window.skip(HEADER);
    loop {
        let view = window.view(LONGEST);
        if view.len() < RECORD {
            break;
        }
        match reader.place(view) {
            Place::Record(len) => {
                reader.in_step = true;
                reader.record(view[2], &view[RECORD..len], wanted);
                window.skip(len);
            }
            Place::Cut => {
                reader.out.findings.push(Finding::warning(format!(
                    "the file ends in the middle of a record, {} bytes of which are left out",
                    view.len()
                )));
                break;
            }
            Place::Damage => {
                reader.damaged();
                window.skip(1);
            }
        }
    }
    (reader.finish(), window)
}

/// Size and kind of the record at the beginning of `view`, if any record begins like that.
fn header(view: &[u8]) -> Option<(usize, u8)> {
    let [low, high, kind, ..] = view else { return None };
    let size = usize::from(u16::from_le_bytes([*low, *high]));
    KINDS.contains(kind).then_some((RECORD + size, *kind))
}

impl Reader {
    /// What stands at the beginning of `view`.
    ///
    /// A record that is followed by another one, or that has the size of its topic, is believed. Where the file is
    /// damaged, several in a row must fit.
    fn place(&self, view: &[u8]) -> Place {
        let Some((len, kind)) = header(view) else { return Place::Damage };
        let exact = kind == b'D' && self.fits(view, len);
        if view.len() < len {
            let believed = self.in_step && (kind != b'D' || exact);
            return if believed { Place::Cut } else { Place::Damage };
        }
        let next = &view[len..];
        let followed = next.len() < RECORD || header(next).is_some();
        let fits = match self.in_step {
            true => exact || followed,
            false => self.is_in_step(view),
        };
        if fits { Place::Record(len) } else { Place::Damage }
    }

    /// Whether the records at the beginning of `view` follow each other, each of the size of its topic.
    fn is_in_step(&self, mut view: &[u8]) -> bool {
        for _ in 0..IN_STEP {
            let Some((len, kind)) = header(view) else { return view.len() < RECORD };
            if kind == b'D' && !self.fits(view, len) {
                return false;
            }
            let Some(rest) = view.get(len..) else { return false };
            view = rest;
        }
        true
    }

    /// Whether a data record of `len` bytes has the size of the topic that it names.
    fn fits(&self, view: &[u8], len: usize) -> bool {
        let number =
            view.get(RECORD..).and_then(|b| b.first_chunk()).map(|b| u16::from_le_bytes(*b));
        let layout = number.and_then(|n| self.subscriptions.get(&n)).map(|s| &s.layout);
        layout.is_some_and(|l| {
            l.size > 0 && (RECORD + 2 + l.size..=RECORD + 2 + l.padded).contains(&len)
        })
    }

    /// Counts a byte that belongs to no record.
    fn damaged(&mut self) {
        if self.in_step {
            self.holes.push(f64::NAN);
        }
        self.in_step = false;
        self.skipped += 1;
    }

    fn record(&mut self, kind: u8, body: &[u8], wanted: &dyn Fn(&str) -> bool) {
        match kind {
            b'F' => self.format(body),
            b'A' => self.subscribe(body, wanted),
            b'D' => self.data(body),
            b'P' => self.parameter(body),
            b'O' => {
                self.dropouts += 1;
                self.dropout_ms += Kind::U16.at(body, 0).max(0.0) as u64;
            }
            _ => {}
        }
    }

    fn format(&mut self, body: &[u8]) {
        let text = String::from_utf8_lossy(body);
        if let Some((name, fields)) = text.split_once(':') {
            self.formats.insert(name.to_owned(), fields.to_owned());
        }
    }

    fn parameter(&mut self, body: &[u8]) {
        let Some((&len, rest)) = body.split_first() else { return };
        let Some((key, value)) = rest.split_at_checked(usize::from(len)) else { return };
        let key = String::from_utf8_lossy(key);
        if let Some((kind, name)) = key.split_once(' ')
            && let Some(kind) = Kind::named(kind)
        {
            let value = kind.at(value, 0);
            if value.is_finite() {
                self.out.parameters.insert(name.to_owned(), value);
            }
        }
    }

    fn subscribe(&mut self, body: &[u8], wanted: &dyn Fn(&str) -> bool) {
        let [instance, low, high, name @ ..] = body else { return };
        let name = String::from_utf8_lossy(name).into_owned();
        if !self.formats.contains_key(&name) {
            self.bad_fields += 1;
        }
        let known = self.layouts.entry(name.clone());
        let layout = known.or_insert_with(|| Rc::new(Layout::of(&self.formats, &name))).clone();
        let wanted = wanted(&name);
        let number = u16::from_le_bytes([*low, *high]);
        let key = (name, u16::from(*instance));
        let old = self
            .subscriptions
            .insert(number, Subscription { key, layout, wanted, topic: None, count: 0 });
        if let Some(old) = old {
            self.keep(old);
        }
    }

    fn data(&mut self, body: &[u8]) {
        let number = body.first_chunk().map(|b| u16::from_le_bytes(*b));
        let Some(subscription) = number.and_then(|n| self.subscriptions.get_mut(&n)) else {
            self.orphans += 1;
            return;
        };
        subscription.count += 1;
        let (body, layout) = (&body[2..], &subscription.layout);
        let Some((kind, offset)) = layout.stamp else { return };
        let stamp_s = kind.at(body, offset) * 1e-6;
        if let Some(hole) = self.holes.last_mut().filter(|hole| hole.is_nan()) {
            *hole = (stamp_s - self.last_s).max(0.0);
        }
        self.last_s = stamp_s;
        if !subscription.wanted {
            return;
        }
        // A record that is too short would be filled up with nothing at many times its size.
        if body.len() < layout.size {
            self.short += 1;
            return;
        }
        let sampled = layout.sampled.map_or(0.0, |(kind, offset)| kind.at(body, offset));
        let micros = if sampled > 0.0 { sampled } else { kind.at(body, offset) };
        if !micros.is_finite() {
            return;
        }
        let topic = subscription
            .topic
            .get_or_insert_with(|| Topic::new(layout.fields.iter().map(|f| f.name.clone())));
        topic.time_s.push(micros * 1e-6);
        for (field, values) in layout.fields.iter().zip(&mut topic.values) {
            values.push(field.kind.at(body, field.offset));
        }
    }

    fn keep(&mut self, old: Subscription) {
        *self.out.counts.entry(old.key.clone()).or_default() += old.count;
        if let Some(topic) = old.topic.filter(|t| !t.time_s.is_empty()) {
            self.out.topics.entry(old.key).or_insert(topic);
        }
    }

    fn finish(mut self) -> Topics {
        let mut subscriptions: Vec<_> =
            std::mem::take(&mut self.subscriptions).into_iter().collect();
        subscriptions.sort_by_key(|(number, _)| *number);
        subscriptions.into_iter().for_each(|(_, s)| self.keep(s));
        self.out.findings.extend(damage(self.skipped, &self.holes));
        if self.dropouts > 0 {
            self.out.findings.push(Finding::warning(format!(
                "the logger dropped out {} times, {} ms in all: rows are missing there",
                self.dropouts, self.dropout_ms
            )));
        }
        if self.orphans + self.bad_fields > 0 {
            self.out.findings.push(Finding::warning(format!(
                "{} records of topics that the file does not declare were left out",
                self.orphans + self.bad_fields
            )));
        }
        if self.short > 0 {
            self.out.findings.push(Finding::warning(format!(
                "{} records are shorter than the file declares them and were left out",
                self.short
            )));
        }
        self.out
    }
}

/// What a damaged file has lost.
pub(super) fn damage(skipped: usize, holes: &[f64]) -> Option<Finding> {
    let lost: f64 = holes.iter().filter(|s| s.is_finite()).sum();
    (skipped > 0).then(|| {
        Finding::warning(format!(
            "{skipped} bytes of the file belong to no record and were skipped: it is damaged there, in {} places, \
             with {lost:.2} s of records lost",
            holes.len().max(1)
        ))
    })
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
                    // An unknown type: nothing behind it can be found.
                    if *offset == before {
                        return;
                    }
                }
            }
        }
    }
}
