//! Reads ArduPilot DataFlash files (`.bin`) into topics: time series of one record type and one instance (such as an IMU).
//!
//! The crate `ardupilot-binlog` (0.2.0) is not used. A FMT record with a length below 3 makes it panic. It ends
//! silently after a number of consecutive errors, so that a truncated log looks complete. It allocates a name and a
//! list for every record, and does not distinguish instances. `tests/logs_crosscheck.py` compares the results with
//! pymavlink.
//!
//! If the time of ATT or IMU records steps back, another flight begins, because a copy of a whole card holds several logs in
//! succession. If a single time is damaged and too large, the step back after it begins no flight.
//!
//! Not read: texts except those of parameter names and the firmware's name, arrays (`a`), and the units and multipliers of FMTU
//! and MULT. The format letters `c C e E L` imply a scale, which pymavlink applies too.

use std::collections::BTreeMap;
use std::io::Read;

use super::finding::Finding;
use super::format::DATAFLASH_MAGIC;
use super::stretches::Keep;
use super::topics::{MOST_FLIGHTS, Topic, Topics, too_many};
use super::ulog::damage;
use super::window::Window;

/// Length of a record's header: two magic bytes and the type.
pub(super) const HEADER: usize = 3;
/// Type number of FMT records, which declare record types, and their length in bytes.
pub(super) const FMT: u8 = 128;
const FMT_LEN: usize = 89;
/// Largest possible length of a record, bytes. The length is declared in one byte.
const LONGEST: usize = 255;
/// Record types in which a backward step of time begins another flight, and the smallest such step, s.
const CLOCKS: [&str; 2] = ["ATT", "IMU"];
const BACK_S: f64 = 1.0;

/// A declared record type.
struct Declared {
    name: String,
    len: usize,
    /// For each field: label, format letter, and offset from the end of the record's header, bytes.
    fields: Vec<(String, u8, usize)>,
    time: Option<(u8, usize, f64)>,
    instance: Option<(u8, usize)>,
    wanted: bool,
    role: Role,
    /// The instances of which records were found.
    read: Vec<Instance>,
}

/// Special use of a record type, in addition to its numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    None,
    Parameter,
    Message,
    Clock,
}

/// One instance of a record type.
struct Instance {
    number: u16,
    count: usize,
    topic: Option<Topic>,
    /// Time of the sample before the last one, s.
    earlier_s: Option<f64>,
}

/// Size of a field with the format `letter`, bytes. `None` for an unknown letter.
pub(super) fn size(letter: u8) -> Option<usize> {
    Some(match letter {
        b'b' | b'B' | b'M' => 1,
        b'h' | b'H' | b'c' | b'C' | b'g' => 2,
        b'i' | b'I' | b'f' | b'n' | b'e' | b'E' | b'L' => 4,
        b'd' | b'q' | b'Q' => 8,
        b'N' => 16,
        b'Z' | b'a' => 64,
        _ => return None,
    })
}

/// Reads the number of format `letter` at `offset`. NaN for texts, arrays and fields beyond the record's end.
fn number(letter: u8, bytes: &[u8], offset: usize) -> f64 {
    fn take<const N: usize>(bytes: &[u8], offset: usize) -> Option<[u8; N]> {
        bytes.get(offset..)?.first_chunk().copied()
    }
    let value = match letter {
        b'b' => take(bytes, offset).map(|b| f64::from(i8::from_le_bytes(b))),
        b'B' | b'M' => take(bytes, offset).map(|b| f64::from(u8::from_le_bytes(b))),
        b'h' => take(bytes, offset).map(|b| f64::from(i16::from_le_bytes(b))),
        b'H' => take(bytes, offset).map(|b| f64::from(u16::from_le_bytes(b))),
        b'c' => take(bytes, offset).map(|b| f64::from(i16::from_le_bytes(b)) / 100.0),
        b'C' => take(bytes, offset).map(|b| f64::from(u16::from_le_bytes(b)) / 100.0),
        b'i' => take(bytes, offset).map(|b| f64::from(i32::from_le_bytes(b))),
        b'I' => take(bytes, offset).map(|b| f64::from(u32::from_le_bytes(b))),
        b'e' => take(bytes, offset).map(|b| f64::from(i32::from_le_bytes(b)) / 100.0),
        b'E' => take(bytes, offset).map(|b| f64::from(u32::from_le_bytes(b)) / 100.0),
        b'L' => take(bytes, offset).map(|b| f64::from(i32::from_le_bytes(b)) * 1e-7),
        b'f' => take(bytes, offset).map(|b| f64::from(f32::from_le_bytes(b))),
        b'd' => take(bytes, offset).map(f64::from_le_bytes),
        b'q' => take(bytes, offset).map(|b| i64::from_le_bytes(b) as f64),
        b'Q' => take(bytes, offset).map(|b| u64::from_le_bytes(b) as f64),
        _ => None,
    };
    value.unwrap_or(f64::NAN)
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).trim().to_owned()
}

/// Reads the type number and the declaration in the body of a FMT record. `None` if the body is too short, a format letter is
/// unknown, or the declared length is shorter than the fields.
fn declaration(body: &[u8], wanted: &dyn Fn(&str) -> bool) -> Option<(u8, Declared)> {
    let (kind, len) = (*body.first()?, usize::from(*body.get(1)?));
    let (name, letters) = (text(body.get(2..6)?), text(body.get(6..22)?));
    let labels = text(body.get(22..86)?);
    let mut fields = Vec::new();
    let mut offset = 0;
    for (letter, label) in letters.bytes().zip(labels.split(',')) {
        fields.push((label.trim().to_owned(), letter, offset));
        offset += size(letter)?;
    }
    if len < HEADER + offset {
        return None;
    }
    let find = |label: &str| fields.iter().find(|f| f.0 == label).map(|f| (f.1, f.2));
    let time = find("TimeUS")
        .map(|(letter, offset)| (letter, offset, 1e-6))
        .or_else(|| find("TimeMS").map(|(letter, offset)| (letter, offset, 1e-3)));
    // The field of the instance has the label `C` in records of the estimator (one instance per core) and `I` in others.
    let label = if name.starts_with("XK") { "C" } else { "I" };
    let instance = find(label).filter(|(letter, _)| *letter == b'B');
    let wanted = wanted(&name);
    let role = match &*name {
        "PARM" => Role::Parameter,
        "MSG" => Role::Message,
        name if CLOCKS.contains(&name) => Role::Clock,
        _ => Role::None,
    };
    let read = Vec::new();
    Some((kind, Declared { name, len, fields, time, instance, wanted, role, read }))
}

#[derive(Default)]
struct Reader {
    /// The declared record types by type number. If a number is declared twice, the first declaration counts.
    declared: Vec<Option<Declared>>,
    keep: Keep,
    /// Values of the present record's fields.
    values: Vec<f64>,
    out: Topics,
    /// Topics of the flights before the present one.
    lives: Vec<Topics>,
    /// Whether the file has more flights than are read.
    full: bool,
    /// Number of bytes that belong to no record, and for each place with such bytes the time between the records around it, s.
    skipped: usize,
    holes: Vec<f64>,
    in_step: bool,
    last_s: f64,
}

/// Reads the records that `wanted` names, parameters and firmware, and counts all others. Returns the topics of each flight.
pub(super) fn read<'a>(
    source: &'a mut dyn Read,
    wanted: &dyn Fn(&str) -> bool,
    keep: Keep,
) -> (Vec<Topics>, Window<'a>) {
    let mut window = Window::new(source);
    let mut reader = Reader { keep, ..Reader::default() };
    let cut = loop {
        let view = window.view(LONGEST + DATAFLASH_MAGIC.len());
        let kind = match view {
            [a, b, kind, ..] if [*a, *b] == DATAFLASH_MAGIC => Some(*kind),
            rest if rest.len() < HEADER => {
                break rest.len();
            }
            _ => None,
        };
        let len = kind.and_then(|kind| match kind {
            FMT => Some(FMT_LEN),
            _ => reader.declared.get(usize::from(kind))?.as_ref().map(|declared| declared.len),
        });
        let (Some(kind), Some(len)) = (kind, len) else {
            reader.damaged();
            window.skip(1);
            continue;
        };
        let Some(body) = view.get(HEADER..len) else {
            break view.len();
        };
        // If bytes of a record were lost or added, no other record begins at its end, and its numbers are invalid.
        let next = &view[len..view.len().min(len + DATAFLASH_MAGIC.len())];
        if kind != FMT && !DATAFLASH_MAGIC.starts_with(next) {
            reader.damaged();
            window.skip(1);
            continue;
        }
        reader.in_step = true;
        reader.record(kind, body, wanted);
        window.skip(len);
    };
    (reader.finish(cut), window)
}

impl Reader {
    /// Counts a byte that belongs to no record.
    fn damaged(&mut self) {
        if self.in_step {
            self.holes.push(f64::NAN);
        }
        self.in_step = false;
        self.skipped += 1;
    }

    fn record(&mut self, kind: u8, body: &[u8], wanted: &dyn Fn(&str) -> bool) {
        if kind == FMT {
            if let Some((kind, declared)) = declaration(body, wanted) {
                let kind = usize::from(kind);
                self.declared.resize_with(self.declared.len().max(kind + 1), || None);
                self.declared[kind].get_or_insert(declared);
            }
            return;
        }
        let Some(Some(declared)) = self.declared.get_mut(usize::from(kind)) else { return };
        match declared.role {
            Role::Parameter => {
                self.out.parameters.extend(parameter(declared, body));
                return;
            }
            Role::Message if self.out.firmware.is_empty() => {
                self.out.firmware = firmware(declared, body).unwrap_or_default();
            }
            _ => {}
        }
        let number_of = |(letter, at)| number(letter, body, at) as u16;
        let instance = declared.instance.map_or(0, number_of);
        let place = declared.read.iter().position(|i| i.number == instance);
        let place = place.unwrap_or_else(|| {
            declared.read.push(Instance {
                number: instance,
                count: 0,
                topic: None,
                earlier_s: None,
            });
            declared.read.len() - 1
        });
        declared.read[place].count += 1;
        let Some((letter, at, unit)) = declared.time else { return };
        let time_s = number(letter, body, at) * unit;
        if let Some(hole) = self.holes.last_mut().filter(|hole| hole.is_nan()) {
            *hole = (time_s - self.last_s).max(0.0);
        }
        self.last_s = time_s;
        if !declared.wanted {
            return;
        }
        let instance = &mut declared.read[place];
        let last = instance.topic.as_ref().and_then(Topic::last_s);
        let earlier = std::mem::replace(&mut instance.earlier_s, last);
        let goes_back = last.is_some_and(|last| time_s < last - BACK_S)
            && earlier.is_none_or(|earlier| time_s <= earlier);
        if declared.role == Role::Clock && goes_back {
            self.full |= self.lives.len() + 1 >= MOST_FLIGHTS;
            if !self.full {
                self.another_life();
            }
        }
        if self.full {
            return;
        }
        self.sample(kind, place, time_s, body);
    }

    /// Ends the present flight. The following records belong to another one.
    fn another_life(&mut self) {
        let topics = self.gathered();
        let parameters = self.out.parameters.clone();
        let firmware = std::mem::take(&mut self.out.firmware);
        self.lives.push(Topics { topics, parameters, firmware, ..Topics::default() });
    }

    /// Adds the numbers of a record of type `kind` to its topic. `place` is the index of the instance in the declared type.
    fn sample(&mut self, kind: u8, place: usize, time_s: f64, body: &[u8]) {
        let Some(Some(declared)) = self.declared.get_mut(usize::from(kind)) else { return };
        self.values.clear();
        self.values.extend(declared.fields.iter().map(|(_, l, offset)| number(*l, body, *offset)));
        let labels = declared.fields.iter().map(|f| f.0.clone());
        let topic = declared.read[place].topic.get_or_insert_with(|| Topic::new(labels, self.keep));
        topic.push(time_s, &self.values);
    }

    /// Moves the topics out of the declared types and returns them by type name and instance number.
    fn gathered(&mut self) -> BTreeMap<(String, u16), Topic> {
        let mut out = BTreeMap::new();
        for declared in self.declared.iter_mut().flatten() {
            for instance in &mut declared.read {
                if let Some(topic) = instance.topic.take() {
                    out.entry((declared.name.clone(), instance.number)).or_insert(topic);
                }
            }
        }
        out
    }

    fn finish(mut self, cut: usize) -> Vec<Topics> {
        for declared in self.declared.iter().flatten() {
            for instance in &declared.read {
                let key = (declared.name.clone(), instance.number);
                *self.out.counts.entry(key).or_default() += instance.count;
            }
        }
        self.out.topics = self.gathered();
        self.out.findings.extend(damage(self.skipped, &self.holes));
        if self.full {
            self.out.findings.push(too_many());
        }
        // a warning only, because the last block of a card is padded and often ends in a cut record
        if cut > 0 {
            self.out.findings.push(Finding::warning(format!(
                "the file ends in the middle of a record, {cut} bytes of which are left out"
            )));
        }
        for life in &mut self.lives {
            life.counts = self.out.counts.clone();
            life.findings = self.out.findings.clone();
        }
        self.lives.push(self.out);
        if self.lives.len() > 1 {
            let named =
                |(k, life): (usize, &mut Topics)| life.life = Some(format!("log {}", k + 1));
            self.lives.iter_mut().enumerate().for_each(named);
        }
        self.lives
    }
}

/// Name and value of the parameter in a record; `None` if the value is not a number.
fn parameter(declared: &Declared, body: &[u8]) -> Option<(String, f64)> {
    let find = |label: &str| declared.fields.iter().find(|f| f.0 == label);
    let (name, value) = (find("Name")?, find("Value")?);
    let value = Some(number(value.1, body, value.2)).filter(|x| x.is_finite())?;
    Some((text(body.get(name.2..name.2 + 16).unwrap_or_default()), value))
}

/// The firmware's name in a MSG record; `None` if its text names no firmware.
fn firmware(declared: &Declared, body: &[u8]) -> Option<String> {
    let message = declared.fields.iter().find(|f| f.0 == "Message");
    let said = message.map(|f| text(body.get(f.2..).unwrap_or_default()));
    said.filter(|t| t.contains("Ardu") || t.contains("APM:"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes of a log with attitude records at the times `times_us`, µs.
    fn log(times_us: &[u64]) -> Vec<u8> {
        let padded = |text: &str, width: usize| {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(width, 0);
            bytes
        };
        let head = vec![0xA3, 0x95, FMT, 7, 15];
        let (letters, labels) = (padded("Qf", 16), padded("TimeUS,Roll", 64));
        let mut out = [head, padded("ATT", 4), letters, labels].concat();
        for time_us in times_us {
            out.extend([0xA3, 0x95, 7]);
            out.extend(time_us.to_le_bytes());
            out.extend(0f32.to_le_bytes());
        }
        out
    }

    #[test]
    fn a_restart_begins_another_flight_and_a_damaged_time_does_not() {
        let flights = |times_us: &[u64]| {
            let bytes = log(times_us);
            let mut source = &bytes[..];
            let (lives, _) = read(&mut source, &|_| true, Keep::All);
            lives.len()
        };
        assert_eq!(flights(&[9_000_000, 9_020_000, 20_000, 40_000]), 2);
        assert_eq!(flights(&[1_000_000, 1_020_000, 9_000_000_000, 1_040_000, 1_060_000]), 1);
    }

    #[test]
    fn a_damaged_file_does_not_hold_thousands_of_flights() {
        let bytes = log(&[1_000_000_u64, 9_000_000].repeat(MOST_FLIGHTS + 50));
        let mut source = &bytes[..];
        let (lives, _) = read(&mut source, &|_| true, Keep::All);
        assert_eq!(lives.len(), MOST_FLIGHTS);
        let said = |life: &Topics| life.findings.contains(&too_many());
        assert!(lives.iter().all(said) && lives.iter().all(|life| life.topics.len() == 1));
        let bytes = log(&[1_000_000_u64, 9_000_000].repeat(MOST_FLIGHTS));
        let mut source = &bytes[..];
        let (lives, _) = read(&mut source, &|_| true, Keep::All);
        assert!(lives.len() == MOST_FLIGHTS && !lives.iter().any(said));
    }
}
