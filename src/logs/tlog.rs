//! Reads MAVLink telemetry logs into topics.
//!
//! A record is the host's time (µs since 1970, big-endian) followed by a frame. The host is the computer that wrote the log.
//! The crate `mavlink` has no reader for such files. The modules of `link` separate the frames and decode the messages.
//!
//! The time of a message is that of the sender's clock. A message without a time stamp (VFR_HUD) has only the host's time. It
//! is converted to the sender's clock by linear interpolation between the messages around it. This is also correct for a
//! simulation that does not run in real time.
//!
//! The clock of a vehicle starts at zero at each boot. The log of each boot of each vehicle is a flight of its own, because its
//! times cannot be compared with those of another boot.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::ops::Range;

use super::finding::Finding;
use super::format::MAVLINK_MARKERS;
use super::mapping::telemetry::PX4;
use super::stretches::Keep;
use super::topics::{MOST_FLIGHTS, Naming, Topic, Topics, too_many};
use super::window::Window;
use greylag_link::framing::{Frame, MAX_FRAME, Whole, frame_len, whole};
use greylag_link::logged::{self, Logged, Own};

/// Bytes of the host's time.
const STAMP: usize = 8;
/// A time stamp that differs by more than this from the clock of its system, s, counts as that of another clock.
const SAME_CLOCK_S: f64 = 5.0;
/// Time after which the 32 bits of `time_boot_ms` overflow, s.
const WRAP_MS_S: f64 = 4_294_967.296;

/// Backward jump of a vehicle's time that counts as a restart, s.
const BACK_S: f64 = 5.0;
/// Number of attitude messages from which a further system counts as a vehicle.
const VEHICLE: usize = 50;
/// Number of successive messages that show a restart. A single message may be late or wrong.
const BACK_FOR: usize = 5;

/// Index of the field `autopilot` among the values of a HEARTBEAT.
const AUTOPILOT: usize = 1;

/// A message whose time is not yet computed.
struct Entry {
    /// Number of its record. Only records with a message of a known type are counted.
    at: usize,
    host_s: f64,
    own_s: Option<f64>,
}

/// A pair of the host's and the sender's time, s, from the record with the number `at`.
#[derive(Clone, Copy)]
struct Tick {
    host_s: f64,
    own_s: f64,
    at: usize,
}

/// The messages of one kind from one sender.
struct Stream {
    topic: &'static str,
    count: usize,
    entries: Vec<Entry>,
    /// Values of the messages; `None` if the messages are only counted.
    values: Option<Topic>,
}

#[derive(Default)]
struct Reader {
    /// The streams by message id and sender.
    streams: BTreeMap<(u32, u16), Stream>,
    /// Clock of each sender, by system × 256 + component.
    clocks: BTreeMap<u16, Vec<Tick>>,
    records: usize,
    /// Parameters as PX4 encodes them, each with the system that sent it.
    bytewise: BTreeMap<String, (u8, f64)>,
    /// Systems whose autopilot is PX4.
    px4: BTreeSet<u8>,
    out: Topics,
    others: BTreeMap<u32, usize>,
}

/// Reads the messages that `wanted` names. All others are only counted.
pub(super) fn read<'a>(
    source: &'a mut dyn Read,
    wanted: &dyn Fn(&str) -> bool,
) -> (Vec<Topics>, Window<'a>) {
    let mut window = Window::new(source);
    let mut reader = Reader::default();
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
        match whole(&frame[..len]) {
            Whole::Known(found) => {
                let stamp = view.first_chunk().map_or(0, |b| u64::from_be_bytes(*b));
                reader.take(&found, stamp as f64 * 1e-6, wanted);
                window.skip(STAMP + len);
            }
            Whole::Unknown => window.skip(STAMP + len),
            Whole::Damaged => {
                window.skip(1);
                skipped += 1;
            }
        }
    };
    (reader.finish(skipped, cut), window)
}

impl Reader {
    fn take(&mut self, frame: &Frame<'_>, host_s: f64, wanted: &dyn Fn(&str) -> bool) {
        self.records += 1;
        let source = u16::from_be_bytes([frame.source.system, frame.source.component]);
        let values = match logged::read(frame) {
            None => {
                *self.others.entry(frame.id).or_default() += 1;
                return;
            }
            Some(Logged::Parameter { name, value, bytewise }) => {
                self.out.parameters.insert(name.clone(), value);
                self.bytewise.insert(name, (frame.source.system, bytewise));
                return;
            }
            Some(Logged::Values(values)) => values,
        };
        if values.topic == "HEARTBEAT" && values.values[AUTOPILOT] == PX4 {
            self.px4.insert(frame.source.system);
        }
        let stream = self.streams.entry((frame.id, source)).or_insert_with(|| {
            let fields = values.fields.iter().copied();
            let topic = wanted(values.topic).then(|| Topic::new(fields, Keep::All));
            Stream { topic: values.topic, count: 0, entries: Vec::new(), values: topic }
        });
        stream.count += 1;
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
        let Some(topic) = &mut stream.values else { return };
        stream.entries.push(Entry { at: self.records, host_s, own_s });
        topic.values.iter_mut().zip(&values.values).for_each(|(column, x)| column.push(*x));
    }

    fn finish(mut self, skipped: usize, cut: usize) -> Vec<Topics> {
        // Components of one system have the same clock. The clock of the component with the most time stamps is the most
        // accurate.
        let mut clocks: BTreeMap<u8, Vec<Tick>> = BTreeMap::new();
        for (source, clock) in std::mem::take(&mut self.clocks) {
            let best = clocks.entry(source.to_be_bytes()[0]).or_default();
            if clock.len() > best.len() {
                *best = clock;
            }
        }
        for ((_, source), stream) in &self.streams {
            *self.out.counts.entry((stream.topic.to_owned(), *source)).or_default() += stream.count;
        }
        for (id, count) in &self.others {
            *self.out.counts.entry((format!("message {id}"), 0)).or_default() += count;
        }
        for (name, (system, value)) in std::mem::take(&mut self.bytewise) {
            if self.px4.contains(&system) {
                self.out.parameters.insert(name, value);
            }
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
        let mut lives = self.lives(&clocks);
        if lives.len() > MOST_FLIGHTS {
            lives.truncate(MOST_FLIGHTS);
            self.out.findings.push(too_many());
        }
        match &lives[..] {
            [] => vec![self.only_life(None, clocks)],
            [(system, _)] => vec![self.only_life(Some(*system), clocks)],
            several => several.iter().map(|(s, at)| self.life(*s, at.clone(), &clocks)).collect(),
        }
    }

    /// Returns all records as one boot of the only vehicle. They are moved, not copied.
    fn only_life(mut self, system: Option<u8>, mut clocks: BTreeMap<u8, Vec<Tick>>) -> Topics {
        let mut out = Topics { system, ..std::mem::take(&mut self.out) };
        clocks.values_mut().for_each(|clock| clock.sort_by(|a, b| a.host_s.total_cmp(&b.host_s)));
        for ((_, source), Stream { topic: name, entries, values, .. }) in self.streams {
            let Some(mut topic) = values else { continue };
            topic.time_s = times(&entries, clocks.get(&source.to_be_bytes()[0]));
            out.topics.insert((name.to_owned(), source), topic);
        }
        out
    }

    /// The boots of the vehicles: for each boot the number of its system and the range of its record numbers. Systems with few
    /// attitude messages are not vehicles, unless no system has more.
    fn lives(&self, clocks: &BTreeMap<u8, Vec<Tick>>) -> Vec<(u8, Range<usize>)> {
        let mut attitudes: BTreeMap<u8, usize> = BTreeMap::new();
        for ((_, source), stream) in &self.streams {
            if stream.topic.starts_with("ATTITUDE") && stream.values.is_some() {
                *attitudes.entry(source.to_be_bytes()[0]).or_default() += stream.count;
            }
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

    /// Returns one boot of `system`: its records whose numbers lie in `at`.
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
        for ((_, source), Stream { topic: name, entries, values, .. }) in &self.streams {
            let Some(topic) = values else { continue };
            let from = entries.partition_point(|e| e.at < at.start);
            let to = entries.partition_point(|e| e.at < at.end);
            if from == to {
                continue;
            }
            let topic = Topic {
                time_s: times(&entries[from..to], ticks.get(&source.to_be_bytes()[0])),
                fields: topic.fields.clone(),
                values: topic.values.iter().map(|v| v[from..to].to_vec()).collect(),
                ..Topic::default()
            };
            out.topics.insert(((*name).to_owned(), *source), topic);
        }
        out
    }
}

/// Numbers of the records at which the vehicle with the clock `clock` starts again.
fn starts(clock: &[Tick]) -> Vec<usize> {
    let back = |i: &usize| {
        let before = clock[i - 1].own_s - BACK_S;
        let after = &clock[*i..clock.len().min(i + BACK_FOR)];
        after.len() == BACK_FOR && after.iter().all(|t| t.own_s < before)
    };
    (1..clock.len()).filter(back).map(|i| clock[i].at).collect()
}

/// A sender's time `own`, s, without the overflow of its 32 bits. `last` is the sender's previous time.
fn unwrapped(own: f64, last: Option<f64>) -> f64 {
    let last = last.unwrap_or(own);
    own + ((last - own) / WRAP_MS_S).round() * WRAP_MS_S
}

/// The times of messages on the clock of their system, s. If that clock is unknown, they are the sender's own times or the
/// host's.
fn times(entries: &[Entry], clock: Option<&Vec<Tick>>) -> Vec<f64> {
    let clock = clock.map_or(&[][..], Vec::as_slice);
    let mut after = 0;
    let time = |entry: &Entry| {
        after = place(clock, entry.host_s, after);
        match (interpolate(clock, entry.host_s, after), entry.own_s) {
            (None, own) => own.unwrap_or(entry.host_s),
            (Some(clock), Some(own)) if (own - clock).abs() < SAME_CLOCK_S => own,
            (Some(clock), _) => clock,
        }
    };
    entries.iter().map(time).collect()
}

/// Number of ticks that are tried in turn before a binary search.
const STEPS: usize = 8;

/// Index of the first tick that is not before the host's time `host` (s). The search begins at the index `from`, because
/// messages mostly arrive in order.
fn place(clock: &[Tick], host: f64, from: usize) -> usize {
    let before = |c: &Tick| c.host_s < host;
    let follows = from == 0 || clock.get(from - 1).is_some_and(before);
    let ahead = clock.get(from..).unwrap_or_default();
    let step = ahead.iter().take(STEPS).position(|c| !before(c)).filter(|_| follows);
    step.map_or_else(|| clock.partition_point(before), |step| from + step)
}

/// The system's time (s) at the host's time `host` (s), interpolated between the ticks before and at the index
/// `after`.
fn interpolate(clock: &[Tick], host: f64, after: usize) -> Option<f64> {
    match (after.checked_sub(1).map(|i| clock[i]), clock.get(after)) {
        (Some(a), Some(b)) if b.host_s > a.host_s && b.host_s > host => {
            Some(a.own_s + (b.own_s - a.own_s) * (host - a.host_s) / (b.host_s - a.host_s))
        }
        (_, Some(b)) => Some(b.own_s),
        (Some(a), None) => Some(a.own_s + (host - a.host_s)),
        (None, None) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A record with a MAVLink 2 frame of the system 1. `extra` is the message's CRC_EXTRA.
    fn record(id: u8, extra: u8, payload: &[u8]) -> Vec<u8> {
        let mut frame = vec![0xFD, payload.len() as u8, 0, 0, 0, 1, 1, id, 0, 0];
        frame.extend(payload);
        let sum = frame[1..].iter().chain(&[extra]).fold(0xFFFF_u16, |sum, byte| {
            let x = byte ^ sum as u8;
            let x = u16::from(x ^ (x << 4));
            (sum >> 8) ^ (x << 8) ^ (x << 3) ^ (x >> 4)
        });
        frame.extend(sum.to_le_bytes());
        [&1_760_000_000_000_000_u64.to_be_bytes()[..], &frame].concat()
    }

    #[test]
    fn an_integer_of_px4_is_read_from_its_bytes() {
        let heartbeat = |autopilot: u8| record(0, 50, &[0, 0, 0, 0, 1, autopilot, 0, 0, 3]);
        // SYS_AUTOSTART = 2106 as INT32, the type 6
        let mut payload = 2106_i32.to_le_bytes().to_vec();
        payload.extend([1, 0, 0, 0]);
        payload.extend(b"SYS_AUTOSTART\0\0\0");
        payload.push(6);
        let parameter = record(22, 220, &payload);
        for (autopilot, expected) in [(12, 2106.0), (3, f64::from(f32::from_bits(2106)))] {
            let log = [heartbeat(autopilot), parameter.clone()].concat();
            let (flights, _) = read(&mut log.as_slice(), &|_| true);
            assert_eq!(flights[0].parameters["SYS_AUTOSTART"], expected);
        }
    }
}
