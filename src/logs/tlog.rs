//! MAVLink telemetry logs read into topics.
//!
//! A record is the host's time (µs since 1970, big-endian) followed by a frame. The crate `mavlink`
//! has no reader for that; frames are cut by `link::framing`, messages named by `link::wire`.
//!
//! Times are the sender's own where a message carries them. A message without (VFR_HUD) gets the
//! own time that belongs to its host time, by linear interpolation between the messages around it:
//! in lockstep, where the host's clock says nothing about the flight's, this is still right.
//! The instance of a topic is system × 256 + component.

use std::collections::BTreeMap;

use super::finding::Finding;
use super::format::MAVLINK_MARKERS;
use super::topics::{Topic, Topics};
use greylag_link::framing::{FrameCounts, Frames, MAX_FRAME, frame_len};
use greylag_link::logged::{self, Logged, Own};

/// Bytes of the host's time.
const STAMP: usize = 8;
/// Own times further than this from the clock of the attitude are another clock's, s.
const SAME_CLOCK_S: f64 = 5.0;
/// Wrap of `time_boot_ms`, of `time_usec` where it has 32 bits, s.
const WRAP_MS_S: f64 = 4_294_967.296;

/// A message before its time is known.
struct Entry {
    host_s: f64,
    own_s: Option<f64>,
}

#[derive(Default)]
struct Reader {
    entries: BTreeMap<(&'static str, u16), (Vec<Entry>, Topic)>,
    /// Host time against own time in whole frames, by system with component.
    clocks: BTreeMap<u16, Vec<(f64, f64)>>,
    out: Topics,
    others: BTreeMap<u32, usize>,
}

/// Reads what `wanted` names; everything else is counted.
pub(super) fn read(bytes: &[u8], wanted: &dyn Fn(&str) -> bool) -> Topics {
    let mut reader = Reader::default();
    let mut counts = FrameCounts::default();
    let (mut at, mut skipped) = (0usize, 0usize);
    let mut cut = 0;
    while at < bytes.len() {
        let Some(frame) = bytes.get(at + STAMP..).filter(|f| !f.is_empty()) else {
            cut = bytes.len() - at;
            break;
        };
        if bytes[at] != 0 || !MAVLINK_MARKERS.contains(&frame[0]) {
            at += 1;
            skipped += 1;
            continue;
        }
        let Some(len) = frame_len(frame).filter(|len| *len <= frame.len()) else {
            if frame.len() < MAX_FRAME {
                cut = bytes.len() - at;
                break;
            }
            at += 1;
            skipped += 1;
            continue;
        };
        let before = counts;
        let found = Frames::new(&frame[..len], &mut counts).next().filter(|f| f.bytes.len() == len);
        if let Some(found) = found {
            let stamp = bytes[at..].first_chunk().map_or(0, |b| u64::from_be_bytes(*b));
            let source = u16::from_be_bytes([found.source.system, found.source.component]);
            match logged::read(&found) {
                Some(message) => reader.take(message, stamp as f64 * 1e-6, source, wanted),
                None => *reader.others.entry(found.id).or_default() += 1,
            }
            at += STAMP + len;
        } else if counts.unknown > before.unknown {
            at += STAMP + len;
        } else {
            at += 1;
            skipped += 1;
        }
    }
    reader.finish(skipped, cut)
}

impl Reader {
    fn take(&mut self, m: Logged, host_s: f64, source: u16, wanted: &dyn Fn(&str) -> bool) {
        let values = match m {
            Logged::Parameter { name, value } => {
                self.out.parameters.insert(name, value);
                return;
            }
            Logged::Values(values) => values,
        };
        let key = (values.topic, source);
        *self.out.counts.entry((values.topic.to_owned(), source)).or_default() += 1;
        let own_s = match values.own {
            Own::BootMs(ms) => {
                let clock = self.clocks.entry(source).or_default();
                let own = unwrapped(f64::from(ms) * 1e-3, clock.last().map(|c| c.1));
                clock.push((host_s, own));
                Some(own)
            }
            Own::Micros(us) => Some(us as f64 * 1e-6),
            Own::None => None,
        };
        if !wanted(values.topic) {
            return;
        }
        let (entries, topic) = self.entries.entry(key).or_insert_with(|| {
            (Vec::new(), Topic::new(values.fields.iter().map(|f| (*f).to_owned())))
        });
        entries.push(Entry { host_s, own_s });
        for (x, column) in values.values.iter().zip(&mut topic.values) {
            column.push(*x);
        }
    }

    fn finish(mut self, skipped: usize, cut: usize) -> Topics {
        // Components of one system share its clock; the one with the most messages tells it best.
        let mut clocks: BTreeMap<u8, Vec<(f64, f64)>> = BTreeMap::new();
        for (source, clock) in self.clocks {
            let best = clocks.entry(source.to_be_bytes()[0]).or_default();
            if clock.len() > best.len() {
                *best = clock;
            }
        }
        clocks.values_mut().for_each(|clock| clock.sort_by(|a, b| a.0.total_cmp(&b.0)));
        for ((name, source), (entries, mut topic)) in self.entries {
            let clock = clocks.get(&source.to_be_bytes()[0]).map_or(&[][..], Vec::as_slice);
            topic.time_s = entries.iter().map(|entry| time(entry, clock)).collect();
            self.out.topics.insert((name.to_owned(), source), topic);
        }
        for (id, count) in self.others {
            *self.out.counts.entry((format!("message {id}"), 0)).or_default() += count;
        }
        if skipped > 0 {
            self.out.findings.push(Finding::warning(format!(
                "{skipped} bytes of the file belong to no record and were skipped: it is damaged there"
            )));
        }
        if cut > 0 {
            self.out.findings.push(Finding::warning(format!(
                "the file ends in the middle of a record, {cut} bytes of which are left out"
            )));
        }
        self.out
    }
}

/// An own time with the wraps of its 32 bits undone.
fn unwrapped(own: f64, last: Option<f64>) -> f64 {
    let last = last.unwrap_or(own);
    own + ((last - own) / WRAP_MS_S).round() * WRAP_MS_S
}

/// The time of a message on its system's clock, s; the host's where the system shows none.
fn time(entry: &Entry, clock: &[(f64, f64)]) -> f64 {
    let Some(own) = interpolate(clock, entry.host_s) else {
        return entry.own_s.unwrap_or(entry.host_s);
    };
    match entry.own_s {
        Some(t) if (t - own).abs() < SAME_CLOCK_S => t,
        _ => own,
    }
}

fn interpolate(clock: &[(f64, f64)], host: f64) -> Option<f64> {
    let after = clock.partition_point(|c| c.0 < host);
    match (after.checked_sub(1).map(|i| clock[i]), clock.get(after)) {
        (Some(a), Some(b)) if b.0 > a.0 && b.0 > host => {
            Some(a.1 + (b.1 - a.1) * (host - a.0) / (b.0 - a.0))
        }
        (_, Some(b)) => Some(b.1),
        (Some(a), None) => Some(a.1 + (host - a.0)),
        (None, None) => None,
    }
}
