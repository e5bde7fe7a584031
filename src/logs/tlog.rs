//! MAVLink telemetry logs read into topics.
//!
//! A record is the host's time (µs since 1970, big-endian) followed by a frame. The crate `mavlink`
//! has no reader for that; frames are cut by `link::framing`, messages named by `link::wire`.
//!
//! The time of a message is that of the sender's clock. A message without a time stamp (VFR_HUD) has only the host's
//! time: it is converted to the sender's clock by linear interpolation between the messages around it. This is correct
//! in lockstep too, where the host's clock is unrelated to that of the flight.
//! The instance of a topic is system × 256 + component.
//!
//! The clock of a vehicle starts at zero at each boot. The log of each boot of each vehicle is a flight of its own, because
//! its times cannot be compared with those of another boot.

use std::collections::BTreeMap;
use std::io::Read;
use std::ops::Range;

use super::finding::Finding;
use super::format::MAVLINK_MARKERS;
use super::stretches::Keep;
use super::topics::{Naming, Topic, Topics};
use super::window::Window;
use greylag_link::framing::{FrameCounts, Frames, MAX_FRAME, frame_len};
use greylag_link::logged::{self, Logged, Own};

/// Bytes of the host's time.
const STAMP: usize = 8;
/// Difference from the clock of the attitude above which a sender's time stamp counts as that of another clock, s.
const SAME_CLOCK_S: f64 = 5.0;
/// Wrap of `time_boot_ms`, of `time_usec` where it has 32 bits, s.
const WRAP_MS_S: f64 = 4_294_967.296;

/// Backward jump of a vehicle's time that counts as a restart, s.
const BACK_S: f64 = 5.0;
/// Number of attitudes from which a further system counts as another vehicle.
const VEHICLE: usize = 50;
/// Number of successive messages that must show a restart: a single one may be late or wrong.
const BACK_FOR: usize = 5;

/// A message before its time is known.
struct Entry {
    /// The number of its record in the file.
    at: usize,
    host_s: f64,
    own_s: Option<f64>,
}

/// A pair of the host's and the sender's time, s, from record number `at`.
#[derive(Clone, Copy)]
struct Tick {
    host_s: f64,
    own_s: f64,
    at: usize,
}

#[derive(Default)]
struct Reader {
    entries: BTreeMap<(&'static str, u16), (Vec<Entry>, Topic)>,
    /// Clock of each sender, by system × 256 + component.
    clocks: BTreeMap<u16, Vec<Tick>>,
    records: usize,
    out: Topics,
    others: BTreeMap<u32, usize>,
}

/// Reads the messages that `wanted` names; all others are counted only.
pub(super) fn read<'a>(
    source: &'a mut dyn Read,
    wanted: &dyn Fn(&str) -> bool,
) -> (Vec<Topics>, Window<'a>) {
    let mut window = Window::new(source);
    let mut reader = Reader::default();
    let mut counts = FrameCounts::default();
    let mut skipped = 0usize;
    let cut = loop {
        let view = window.view(STAMP + MAX_FRAME);
        let Some(frame) = view.get(STAMP..).filter(|f| !f.is_empty()) else {
            break view.len();
        };
        if view[0] != 0 || !MAVLINK_MARKERS.contains(&frame[0]) {
            window.skip(1);
            skipped += 1;
            continue;
        }
        let Some(len) = frame_len(frame).filter(|len| *len <= frame.len()) else {
            if frame.len() < MAX_FRAME {
                break view.len();
            }
            window.skip(1);
            skipped += 1;
            continue;
        };
        let before = counts;
        let found = Frames::new(&frame[..len], &mut counts).next().filter(|f| f.bytes.len() == len);
        if let Some(found) = found {
            let stamp = view.first_chunk().map_or(0, |b| u64::from_be_bytes(*b));
            let source = u16::from_be_bytes([found.source.system, found.source.component]);
            reader.records += 1;
            match logged::read(&found) {
                Some(message) => reader.take(message, stamp as f64 * 1e-6, source, wanted),
                None => *reader.others.entry(found.id).or_default() += 1,
            }
            window.skip(STAMP + len);
        } else if counts.unknown > before.unknown {
            window.skip(STAMP + len);
        } else {
            window.skip(1);
            skipped += 1;
        }
    };
    (reader.finish(skipped, cut), window)
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
                let own_s = unwrapped(f64::from(ms) * 1e-3, clock.last().map(|c| c.own_s));
                clock.push(Tick { host_s, own_s, at: self.records });
                Some(own_s)
            }
            Own::Micros(us) => Some(us as f64 * 1e-6),
            Own::None => None,
        };
        if !wanted(values.topic) {
            return;
        }
        let (entries, topic) = self.entries.entry(key).or_insert_with(|| {
            (Vec::new(), Topic::new(values.fields.iter().map(|f| (*f).to_owned()), Keep::All))
        });
        entries.push(Entry { at: self.records, host_s, own_s });
        for (x, column) in values.values.iter().zip(&mut topic.values) {
            column.push(*x);
        }
    }

    fn finish(mut self, skipped: usize, cut: usize) -> Vec<Topics> {
        // Components of one system share its clock; the one with the most messages is the most accurate.
        let mut clocks: BTreeMap<u8, Vec<Tick>> = BTreeMap::new();
        for (source, clock) in std::mem::take(&mut self.clocks) {
            let best = clocks.entry(source.to_be_bytes()[0]).or_default();
            if clock.len() > best.len() {
                *best = clock;
            }
        }
        for (id, count) in &self.others {
            *self.out.counts.entry((format!("message {id}"), 0)).or_default() += count;
        }
        self.out.naming = Naming::Sender;
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
        let lives = self.lives(&clocks);
        match &lives[..] {
            [] => vec![self.only_life(None, clocks)],
            [(system, _)] => vec![self.only_life(Some(*system), clocks)],
            several => several.iter().map(|(s, at)| self.life(*s, at.clone(), &clocks)).collect(),
        }
    }

    /// All records as one boot of the only vehicle, without a copy.
    fn only_life(mut self, system: Option<u8>, mut clocks: BTreeMap<u8, Vec<Tick>>) -> Topics {
        let mut out = Topics { system, ..std::mem::take(&mut self.out) };
        clocks.values_mut().for_each(|clock| clock.sort_by(|a, b| a.host_s.total_cmp(&b.host_s)));
        for ((name, source), (entries, mut topic)) in self.entries {
            let clock = clocks.get(&source.to_be_bytes()[0]).map_or(&[][..], Vec::as_slice);
            topic.time_s = entries.iter().map(|entry| time(entry, clock)).collect();
            out.topics.insert((name.to_owned(), source), topic);
        }
        out
    }

    /// The boots of the systems that send an attitude: each system with the range of its records.
    fn lives(&self, clocks: &BTreeMap<u8, Vec<Tick>>) -> Vec<(u8, Range<usize>)> {
        let mut attitudes: BTreeMap<u8, usize> = BTreeMap::new();
        for ((_, source), (entries, _)) in
            self.entries.iter().filter(|((name, _), _)| name.starts_with("ATTITUDE"))
        {
            *attitudes.entry(source.to_be_bytes()[0]).or_default() += entries.len();
        }
        let most = attitudes.iter().max_by_key(|(_, count)| **count).map(|(system, _)| *system);
        let is_one = |system: u8, count: usize| count >= VEHICLE || Some(system) == most;
        let vehicles = attitudes.into_iter().filter(|(system, count)| is_one(*system, *count));
        let systems: Vec<u8> = vehicles.map(|(system, _)| system).collect();
        let of = |system: u8| {
            let mut bounds = vec![0];
            bounds.extend(clocks.get(&system).map(|c| starts(c)).unwrap_or_default());
            bounds.push(usize::MAX);
            let lives: Vec<_> = bounds.windows(2).map(|w| (system, w[0]..w[1])).collect();
            lives
        };
        systems.into_iter().flat_map(of).collect()
    }

    /// The records `at` of `system`, one of several boots in the file.
    fn life(&self, system: u8, at: Range<usize>, clocks: &BTreeMap<u8, Vec<Tick>>) -> Topics {
        let whole = at == (0..usize::MAX);
        let own = |source: u16| source.to_be_bytes()[0] == system;
        let counts = self.out.counts.iter().filter(|((_, source), _)| *source == 0 || own(*source));
        let mut out = Topics {
            system: Some(system),
            counts: counts.map(|(key, count)| (key.clone(), *count)).collect(),
            parameters: self.out.parameters.clone(),
            findings: self.out.findings.clone(),
            naming: self.out.naming,
            ..Topics::default()
        };
        out.life = Some(match whole {
            true => format!("system {system}"),
            false => format!("system {system} from record {}", at.start.max(1)),
        });
        let mut ticks: BTreeMap<u8, Vec<Tick>> = BTreeMap::new();
        for (system, clock) in clocks {
            let mut own: Vec<Tick> = clock.iter().filter(|t| at.contains(&t.at)).copied().collect();
            own.sort_by(|a, b| a.host_s.total_cmp(&b.host_s));
            ticks.insert(*system, own);
        }
        for ((name, source), (entries, topic)) in &self.entries {
            let from = entries.partition_point(|e| e.at < at.start);
            let to = entries.partition_point(|e| e.at < at.end);
            if from == to {
                continue;
            }
            let clock = ticks.get(&source.to_be_bytes()[0]).map_or(&[][..], Vec::as_slice);
            let topic = Topic {
                time_s: entries[from..to].iter().map(|entry| time(entry, clock)).collect(),
                fields: topic.fields.clone(),
                values: topic.values.iter().map(|v| v[from..to].to_vec()).collect(),
                ..Topic::default()
            };
            out.topics.insert(((*name).to_owned(), *source), topic);
        }
        out
    }
}

/// Records at which a vehicle has restarted.
fn starts(clock: &[Tick]) -> Vec<usize> {
    let back = |i: &usize| {
        let before = clock[i - 1].own_s - BACK_S;
        let after = &clock[*i..clock.len().min(i + BACK_FOR)];
        after.len() == BACK_FOR && after.iter().all(|t| t.own_s < before)
    };
    (1..clock.len()).filter(back).map(|i| clock[i].at).collect()
}

/// A sender's time, s, with the overflow of its 32 bits removed.
fn unwrapped(own: f64, last: Option<f64>) -> f64 {
    let last = last.unwrap_or(own);
    own + ((last - own) / WRAP_MS_S).round() * WRAP_MS_S
}

/// The time of a message on its system's clock, s; the host's where the system shows none.
fn time(entry: &Entry, clock: &[Tick]) -> f64 {
    let Some(own) = interpolate(clock, entry.host_s) else {
        return entry.own_s.unwrap_or(entry.host_s);
    };
    match entry.own_s {
        Some(t) if (t - own).abs() < SAME_CLOCK_S => t,
        _ => own,
    }
}

fn interpolate(clock: &[Tick], host: f64) -> Option<f64> {
    let after = clock.partition_point(|c| c.host_s < host);
    match (after.checked_sub(1).map(|i| clock[i]), clock.get(after)) {
        (Some(a), Some(b)) if b.host_s > a.host_s && b.host_s > host => {
            Some(a.own_s + (b.own_s - a.own_s) * (host - a.host_s) / (b.host_s - a.host_s))
        }
        (_, Some(b)) => Some(b.own_s),
        (Some(a), None) => Some(a.own_s + (host - a.host_s)),
        (None, None) => None,
    }
}
