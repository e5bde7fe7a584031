//! Reads PX4 ULog files into topics (types of messages with their time series).
//!
//! A ULog file consists of records: formats of topics, subscriptions (which give a topic a message number), data records with
//! such a number, parameters, and others.
//!
//! No published crate is used (examined: `px4-ulog` 0.6.1, `yule_log` 0.4.0). `px4-ulog` stops at the first inconsistent record
//! and refuses a second subscription with the same message number. It panics by design where a value's type changes. `yule_log`
//! depends on a logger and on a regular-expression engine. Neither can skip topics that are not needed.
//! `tests/logs_crosscheck.py` compares the results with pyulog.
//!
//! Not read: logged strings, offsets of appended data (it is read in file order), default values of parameters. If a parameter
//! changes in flight, the last value is kept.

mod layout;
mod subscriptions;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::rc::Rc;

use super::finding::Finding;
use super::format::ULOG_MAGIC;
use super::number::Number;
use super::stretches::Keep;
use super::topics::{Topic, Topics};
use super::window::Window;
use layout::Layout;
use subscriptions::{Series, Subscription, Subscriptions};

/// Size of the file's header (magic, version and start time), bytes.
const HEADER: usize = 16;
/// Size of a record's header (size and kind), bytes.
const RECORD: usize = 3;
/// Number of bytes that are viewed at once: the longest record and the beginning of the records after it.
const LONGEST: usize = RECORD + u16::MAX as usize + 1024;
/// Number of successive records that must be valid before a record is accepted.
const IN_STEP: usize = 3;
/// Letters that stand for the kinds of records.
const KINDS: &[u8] = b"BFIMPQARDCLSO";

/// The records after the present one that were found valid: their number, and their size in bytes.
#[derive(Clone, Copy, Default)]
struct Ahead {
    records: usize,
    bytes: usize,
}

#[derive(Default)]
struct Reader {
    /// Records after the last accepted one that were found valid together with it.
    ahead: Ahead,
    formats: BTreeMap<String, String>,
    /// The layout of each topic. All subscriptions of the topic share it.
    layouts: BTreeMap<String, Rc<Layout>>,
    subscriptions: Subscriptions,
    series: Series,
    keep: Keep,
    /// The values of the present record.
    values: Vec<f64>,
    out: Topics,
    dropout_ms: u64,
    dropouts: usize,
    /// Number of data records whose message number has no subscription.
    orphans: usize,
    /// Topics that were subscribed to before the file stated their format.
    formless: BTreeSet<String>,
    /// Number of data records that are shorter than their topic's layout.
    short: usize,
    /// Whether a valid record ends at the present place of the file.
    in_step: bool,
    /// Number of bytes that belong to no record.
    skipped: usize,
    /// Length of the gap at each damaged place, s: from the last data record before it to the first one after it. NaN until that
    /// record is read.
    holes: Vec<f64>,
    /// Time of the last data record, s.
    last_s: f64,
}

/// Whether data records of topics without a subscription may count as valid.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Undeclared {
    Allowed,
    Refused,
}

/// What begins at a place of the file.
enum Place {
    /// A valid record of this many bytes, including its header.
    Record(usize),
    /// A record that the end of the file cuts off.
    Cut,
    /// No valid record.
    Damage,
}

/// Reads the fields for which `wanted(topic, field)` is true. Records of all topics are counted.
pub(super) fn read<'a>(
    source: &'a mut dyn Read,
    wanted: &dyn Fn(&str, &str) -> bool,
    keep: Keep,
) -> (Topics, Window<'a>) {
    let mut window = Window::new(source);
    let mut reader = Reader { in_step: true, keep, ..Reader::default() };
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

/// Length (bytes, including the header) and kind of the record at the beginning of `view`; `None` if no record begins there.
fn header(view: &[u8]) -> Option<(usize, u8)> {
    let [low, high, kind, ..] = view else { return None };
    let size = usize::from(u16::from_le_bytes([*low, *high]));
    KINDS.contains(kind).then_some((RECORD + size, *kind))
}

impl Reader {
    /// What `view` begins with.
    ///
    /// A record is valid if the records that follow it are valid too. After a damaged place, it and the records that follow must
    /// moreover be data records with the sizes of their topics.
    fn place(&mut self, view: &[u8]) -> Place {
        let Some((len, kind)) = header(view) else { return Place::Damage };
        let exact = kind == b'D' && self.fits(view, len);
        if view.len() < len {
            let believed = self.in_step && (kind != b'D' || exact);
            return if believed { Place::Cut } else { Place::Damage };
        }
        let fits = match self.in_step {
            // the right size does not suffice, because the damage may begin within the record
            true => self.goes_on(&view[len..], len, kind),
            false => self.is_in_step(view, IN_STEP, Undeclared::Refused),
        };
        if fits { Place::Record(len) } else { Place::Damage }
    }

    /// Whether valid records follow a record of this kind and `len` bytes. `rest` begins after this record. If it is a data
    /// record, the following records that were already checked for the record before are not checked again.
    fn goes_on(&mut self, rest: &[u8], len: usize, kind: u8) -> bool {
        let seen = match self.ahead {
            Ahead { records, bytes } if kind == b'D' && records > 0 && bytes >= len => {
                Ahead { records: records - 1, bytes: bytes - len }
            }
            _ => Ahead::default(),
        };
        self.ahead = Ahead::default();
        let Some(unseen) = rest.get(seen.bytes..) else {
            return self.is_in_step(rest, IN_STEP, Undeclared::Allowed);
        };
        if !self.is_in_step(unseen, IN_STEP - seen.records, Undeclared::Allowed) {
            return false;
        }
        let mut ahead = seen;
        while ahead.records < IN_STEP {
            let Some((next, _)) = rest.get(ahead.bytes..).and_then(header) else { break };
            if rest.len() < ahead.bytes + next {
                break;
            }
            ahead = Ahead { records: ahead.records + 1, bytes: ahead.bytes + next };
        }
        // a record other than data may declare topics, so the records after it are checked again
        self.ahead = if kind == b'D' { ahead } else { Ahead::default() };
        true
    }

    /// Whether `view` begins with `count` valid records. A data record is valid if it has the size of its topic.
    fn is_in_step(&self, mut view: &[u8], count: usize, undeclared: Undeclared) -> bool {
        for _ in 0..count {
            let Some((len, kind)) = header(view) else { return view.len() < RECORD };
            if kind == b'D' {
                let number = view.get(RECORD..).and_then(|b| b.first_chunk::<2>());
                let known = number.and_then(|n| self.subscriptions.get(u16::from_le_bytes(*n)));
                let fits = known.and_then(|known| known.fits(len));
                if !fits.unwrap_or(undeclared == Undeclared::Allowed) {
                    return false;
                }
            }
            // the bytes of a number may look like another kind of record, so reading resumes only at data records
            if kind != b'D' && undeclared == Undeclared::Refused {
                return false;
            }
            // if the view ends within a record, only the existing bytes of the record are checked
            let Some(rest) = view.get(len..) else { return undeclared == Undeclared::Allowed };
            view = rest;
        }
        true
    }

    /// Whether the data record at the beginning of `view`, of `len` bytes, has the size of its topic.
    fn fits(&self, view: &[u8], len: usize) -> bool {
        let number = view.get(RECORD..).and_then(|b| b.first_chunk());
        let known = number.and_then(|b| self.subscriptions.get(u16::from_le_bytes(*b)));
        known.and_then(|known| known.fits(len)).unwrap_or(false)
    }

    /// Counts a byte that belongs to no record.
    fn damaged(&mut self) {
        if self.in_step {
            self.holes.push(f64::NAN);
        }
        self.in_step = false;
        self.ahead = Ahead::default();
        self.skipped += 1;
    }

    fn record(&mut self, kind: u8, body: &[u8], wanted: &dyn Fn(&str, &str) -> bool) {
        match kind {
            b'F' => self.format(body),
            b'A' => self.subscribe(body, wanted),
            b'D' => self.data(body),
            b'P' => self.parameter(body),
            b'O' => {
                self.dropouts += 1;
                self.dropout_ms += Number::U16.at(body, 0).max(0.0) as u64;
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
            && let Some(kind) = Number::named(kind)
        {
            let value = kind.at(value, 0);
            if value.is_finite() {
                self.out.parameters.insert(name.to_owned(), value);
            }
        }
    }

    fn subscribe(&mut self, body: &[u8], wanted: &dyn Fn(&str, &str) -> bool) {
        let [instance, low, high, name @ ..] = body else { return };
        let name = String::from_utf8_lossy(name).into_owned();
        if !self.formats.contains_key(&name) {
            self.formless.insert(name.clone());
        }
        let known = self.layouts.entry(name.clone());
        let layout = known.or_insert_with(|| {
            let mut layout = Layout::of(&self.formats, &name);
            layout.fields.retain(|f| wanted(&name, &f.name));
            layout.fields.shrink_to_fit();
            Rc::new(layout)
        });
        let layout = layout.clone();
        let number = u16::from_le_bytes([*low, *high]);
        let key = (name, u16::from(*instance));
        let old =
            self.subscriptions.insert(number, Subscription { key, layout, place: None, count: 0 });
        if let Some(old) = old {
            self.count(old);
        }
    }

    fn data(&mut self, body: &[u8]) {
        let number = body.first_chunk().map(|b| u16::from_le_bytes(*b));
        let Some(subscription) = number.and_then(|n| self.subscriptions.get_mut(n)) else {
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
        if layout.fields.is_empty() {
            return;
        }
        // a short record is damaged; its sample would also need much more memory than the record
        if body.len() < layout.size {
            self.short += 1;
            return;
        }
        let sampled = layout.sampled.map_or(0.0, |(kind, offset)| kind.at(body, offset));
        let micros = if sampled > 0.0 { sampled } else { kind.at(body, offset) };
        if !micros.is_finite() {
            return;
        }
        let place = match subscription.place {
            Some(place) => place,
            None => {
                let names = layout.fields.iter().map(|f| f.name.clone());
                self.series.place(&subscription.key, || Topic::new(names, self.keep))
            }
        };
        subscription.place = Some(place);
        self.values.clear();
        self.values.extend(layout.fields.iter().map(|f| f.kind.at(body, f.offset)));
        self.series.at(place).push(micros * 1e-6, &self.values);
    }

    /// Adds the number of data records of the subscription `old`, which has ended, to the count of its topic.
    fn count(&mut self, old: Subscription) {
        *self.out.counts.entry(old.key).or_default() += old.count;
    }

    fn finish(mut self) -> Topics {
        let subscriptions = std::mem::take(&mut self.subscriptions).all;
        subscriptions.into_iter().for_each(|(_, s)| self.count(s));
        self.out.topics = std::mem::take(&mut self.series).all();
        self.out.findings.extend(damage(self.skipped, &self.holes));
        if self.dropouts > 0 {
            self.out.findings.push(Finding::warning(format!(
                "the logger dropped out {} times, {} ms in all: rows are missing there",
                self.dropouts, self.dropout_ms
            )));
        }
        if self.orphans > 0 {
            self.out.findings.push(Finding::warning(format!(
                "{} records of topics that the file does not declare were left out",
                self.orphans
            )));
        }
        if !self.formless.is_empty() {
            let of = self.out.counts.iter().filter(|((name, _), _)| self.formless.contains(name));
            let records: usize = of.map(|(_, count)| count).sum();
            self.out.findings.push(Finding::warning(format!(
                "the file lacks the format of {} topics that it subscribes to: their {records} records were left out",
                self.formless.len()
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

/// A finding about a damaged file; `None` if no byte was skipped. `holes` are the times that were lost at each damaged place, s.
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
