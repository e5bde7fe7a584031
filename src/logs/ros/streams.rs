//! The topics of a ROS 2 bag: how their messages are read, and to which vehicle each topic belongs.
//!
//! A stamp is the time that a message carries. The recorder's time is the time at which the bag received the message.

use std::collections::BTreeMap;

use super::JUMP_S;
use super::definition::{Plan, STAMPS, STEPS};
use super::records::{Channel, Schema};
use crate::finding::Finding;
use crate::stretches::Keep;
use crate::topics::{Topic, Topics};

/// Stamps above this value, s, count from 1970. Lower ones count from the boot of the vehicle or the start of a simulation.
const SINCE_1970_S: f64 = 1e8;
/// Number of attitude messages from which a namespace counts as a vehicle.
const VEHICLE: usize = 10;
/// Topics with an attitude, by which the vehicles are counted.
const ATTITUDES: [&str; 2] = ["vehicle_attitude", "imu/data"];

/// Package of the messages of PX4.
const PX4: &str = "px4_msgs/";

/// A topic of the bag.
struct Stream {
    /// Namespace of the vehicle; empty if the topic has none.
    vehicle: String,
    /// Name of the topic in rules and mappings.
    name: String,
    /// Whether its messages are of the package `px4_msgs`, whose `timestamp` is in microseconds.
    px4: bool,
    count: usize,
    /// The steps by which its messages are read; `None` if the topic is not requested or cannot be read.
    plan: Option<Plan>,
    topic: Option<Topic>,
    /// Number of messages that do not fit the definition or are too long.
    unfit: usize,
    /// Reason why its requested messages cannot be read; `None` if they can.
    unread: Option<String>,
}

/// Relation of the stamps to the recorder's time.
#[derive(Default)]
struct Clock {
    /// Whole seconds that are subtracted from the stamps. Zero for a clock that starts at a boot.
    epoch_s: Option<f64>,
    /// Recorder's time minus the message's time, s.
    offset_s: Option<f64>,
    /// Correction that is added to the stamps, s.
    shift_s: f64,
    jumps: usize,
}

impl Clock {
    /// The time of a message, s, from its stamp and the recorder's time (s). If the stamps jump relative to the recorder's
    /// time, the jump is removed.
    fn time(&mut self, stamp_s: f64, log_s: f64) -> f64 {
        let time = stamp_s + self.shift_s;
        let offset = log_s - time;
        match self.offset_s {
            Some(last) if (offset - last).abs() > JUMP_S => {
                self.shift_s += offset - last;
                self.jumps += 1;
                log_s - last
            }
            _ => {
                self.offset_s = Some(offset);
                time
            }
        }
    }
}

/// The topics of a bag.
pub(super) struct Streams<'w> {
    wanted: &'w dyn Fn(&str, &str) -> bool,
    keep: Keep,
    schemas: BTreeMap<u16, Schema>,
    /// Index of the stream of each channel.
    channels: BTreeMap<u16, usize>,
    /// Index of the stream of each topic, by the topic's full name.
    by_topic: BTreeMap<String, usize>,
    streams: Vec<Stream>,
    /// The clocks of the stamps `header.stamp` and `timestamp`.
    clocks: [Clock; 2],
    /// Whole second of the first message on the recorder's clock. The recorder's times count from it.
    log_epoch_s: Option<u64>,
    values: Vec<f64>,
    /// Number of steps that further plans may have. The limit keeps a damaged file from using much memory.
    budget: usize,
    /// Number of messages on channels that the file does not declare.
    orphans: usize,
    /// Number of definitions and declarations that cannot be read.
    unreadable: usize,
}

impl<'w> Streams<'w> {
    /// Makes an empty collection. The fields for which `wanted(topic, field)` is true are read.
    pub fn new(wanted: &'w dyn Fn(&str, &str) -> bool, keep: Keep) -> Streams<'w> {
        Streams {
            wanted,
            keep,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            by_topic: BTreeMap::new(),
            streams: Vec::new(),
            clocks: Default::default(),
            log_epoch_s: None,
            values: Vec::new(),
            budget: STEPS,
            orphans: 0,
            unreadable: 0,
        }
    }

    /// Takes the definition of a message type.
    pub fn define(&mut self, schema: Option<Schema>) {
        match schema {
            Some(schema) => drop(self.schemas.insert(schema.id, schema)),
            None => self.unreadable += 1,
        }
    }

    /// Takes the declaration of a channel. A second channel of the same topic fills the stream of the first.
    pub fn declare(&mut self, channel: Option<Channel>) {
        let Some(channel) = channel else {
            self.unreadable += 1;
            return;
        };
        if let Some(stream) = self.by_topic.get(&channel.topic) {
            self.channels.insert(channel.id, *stream);
            return;
        }
        let schema = self.schemas.get(&channel.schema);
        let kind = schema.map_or("", |s| &s.name);
        let (px4, (vehicle, name)) = (kind.starts_with(PX4), named(&channel.topic, kind));
        let wanted = |field: &str| (self.wanted)(&name, field);
        let encoding = &channel.encoding;
        // A plan is made only for a topic with fields that may be requested.
        let (plan, unread) =
            match wanted(ANY).then(|| planned(schema, encoding, &wanted, &mut self.budget)) {
                None => (None, None),
                Some(Ok(plan)) => (plan.filter(|plan| !plan.fields.is_empty()), None),
                Some(Err(why)) => (None, Some(why)),
            };
        let topic = plan.as_ref().map(|plan| Topic::new(plan.fields.iter().cloned(), self.keep));
        let stream = Stream { vehicle, name, px4, count: 0, plan, topic, unfit: 0, unread };
        self.by_topic.insert(channel.topic.clone(), self.streams.len());
        self.channels.insert(channel.id, self.streams.len());
        self.streams.push(stream);
    }

    /// Whether the file declares a channel.
    pub fn knows(&self, channel: u16) -> bool {
        self.channels.contains_key(&channel)
    }

    /// Counts a message and returns whether it must be read. A message that is too long (not `short`) is only counted.
    pub fn counts(&mut self, channel: u16, short: bool) -> bool {
        let stream = self.channels.get(&channel).and_then(|i| self.streams.get_mut(*i));
        let Some(stream) = stream else {
            self.orphans += 1;
            return false;
        };
        stream.count += 1;
        stream.unfit += usize::from(stream.plan.is_some() && !short);
        stream.plan.is_some() && short
    }

    /// Reads a message that the recorder received at `log_ns` (ns since 1970).
    pub fn take(&mut self, channel: u16, log_ns: u64, message: &[u8]) {
        let stream = self.channels.get(&channel).and_then(|i| self.streams.get_mut(*i));
        let Some(stream) = stream else { return };
        let (Some(plan), Some(topic)) = (&stream.plan, &mut stream.topic) else { return };
        if !plan.decode(message, &mut self.values) {
            stream.unfit += 1;
            return;
        }
        // Times count from a whole second, which keeps their differences exact to a nanosecond.
        let base = *self.log_epoch_s.get_or_insert(log_ns / 1_000_000_000);
        let log_s = (i128::from(log_ns) - i128::from(base) * 1_000_000_000) as f64 * 1e-9;
        let [sec, nanosec, timestamp, sampled] = [0, 1, 2, 3].map(|i| self.values[i]);
        let (clock, whole_s, rest_s) = if stream.px4 && timestamp > 0.0 {
            let micros = if sampled > 0.0 { sampled } else { timestamp };
            (1, (micros / 1e6).floor(), micros % 1e6 * 1e-6)
        } else {
            (0, sec, nanosec * 1e-9)
        };
        let own = &mut self.clocks[clock];
        let time_s = if whole_s + rest_s > 0.0 {
            let epoch = *own.epoch_s.get_or_insert(match whole_s > SINCE_1970_S {
                // the first message may not be the earliest one, so that times count from one second earlier
                true => whole_s - 1.0,
                false => 0.0,
            });
            own.time(whole_s - epoch + rest_s, log_s)
        } else {
            let offset = self.clocks.iter().find_map(|clock| clock.offset_s);
            log_s - offset.unwrap_or(-1.0)
        };
        topic.push(time_s, &self.values[STAMPS.len()..]);
    }

    /// The flights of the bag: one for each vehicle with an attitude. If there is at most one vehicle, one flight has all
    /// topics.
    pub fn finish(self, mut findings: Vec<Finding>) -> Vec<Topics> {
        findings.extend(self.said().into_iter().map(Finding::warning));
        let mut vehicles: BTreeMap<String, Vec<Stream>> = BTreeMap::new();
        for stream in self.streams {
            vehicles.entry(stream.vehicle.clone()).or_default().push(stream);
        }
        let several = vehicles.values().filter(|streams| attitudes(streams) >= VEHICLE).count() > 1;
        if !several {
            return vec![topics(vehicles.into_values().flatten().collect(), findings, None)];
        }
        vehicles.retain(|_, streams| attitudes(streams) >= VEHICLE);
        let one = |(vehicle, streams): (String, Vec<Stream>)| {
            topics(streams, findings.clone(), Some(format!("vehicle {vehicle}")))
        };
        vehicles.into_iter().map(one).collect()
    }

    /// Texts about messages that were left out, and about removed jumps of the stamps.
    fn said(&self) -> Vec<String> {
        let mut said = Vec::new();
        if self.orphans + self.unreadable > 0 {
            said.push(format!(
                "{} messages or declarations of topics that the file does not declare readably were left out",
                self.orphans + self.unreadable
            ));
        }
        let jumps: usize = self.clocks.iter().map(|clock| clock.jumps).sum();
        if jumps > 0 {
            said.push(format!(
                "the stamps of the messages jump {jumps} times against the recorder's time, which bridges it"
            ));
        }
        said
    }
}

/// Number of messages with the attitude of a vehicle.
fn attitudes(streams: &[Stream]) -> usize {
    let attitude = |s: &&Stream| ATTITUDES.contains(&s.name.as_str());
    streams.iter().filter(attitude).map(|s| s.count).sum()
}

impl Stream {
    /// Text about messages of the topic that were left out; `None` if there are none.
    fn said(&self) -> Option<String> {
        let (count, name) = (self.count, &self.name);
        match &self.unread {
            Some(why) if count > 0 => Some(format!("{count} messages of {name} were left out: {why}")),
            _ => (self.unfit > 0).then(|| {
                format!(
                    "{} of {count} messages of {name} do not fit their definition and were left out",
                    self.unfit
                )
            }),
        }
    }
}

/// Field name that stands for any field of a topic.
pub(super) const ANY: &str = "";

/// The plan for reading a channel's messages; `None` if the channel has no definition. The error is the reason why the messages
/// cannot be read.
fn planned(
    schema: Option<&Schema>,
    encoding: &str,
    wanted: &dyn Fn(&str) -> bool,
    budget: &mut usize,
) -> Result<Option<Plan>, String> {
    let Some(schema) = schema else { return Ok(None) };
    if encoding != "cdr" || schema.encoding != "ros2msg" {
        return Err(format!(
            "its messages are in `{encoding}` by a definition in `{}`; read are `cdr` by `ros2msg`",
            schema.encoding
        ));
    }
    let plan = Plan::of(&schema.name, &schema.text, wanted, budget);
    plan.map(Some).ok_or_else(|| format!("the definition of {} is not whole", schema.name))
}

/// Splits the full name `topic` into the namespace of the vehicle and the name in rules and mappings. `kind` is the
/// type of its messages.
fn named(topic: &str, kind: &str) -> (String, String) {
    let topic = topic.trim_start_matches('/');
    if kind.starts_with(PX4) {
        let (before, last) = topic.rsplit_once('/').unwrap_or(("", topic));
        let versioned =
            last.rsplit_once("_v").filter(|(_, v)| v.bytes().all(|b| b.is_ascii_digit()));
        let name = versioned.map_or(last, |(name, _)| name);
        let vehicle = before.strip_suffix("fmu/out").or(before.strip_suffix("fmu/in"));
        let vehicle = vehicle.unwrap_or(before).trim_end_matches('/');
        return (vehicle.to_owned(), name.to_owned());
    }
    let at = if topic.starts_with("mavros/") { Some(0) } else { topic.find("/mavros/") };
    match at {
        Some(at) => {
            let name = topic[at..].trim_start_matches('/').trim_start_matches("mavros/");
            (topic[..at].to_owned(), name.to_owned())
        }
        None => (String::new(), topic.to_owned()),
    }
}

/// Collects the topics of a flight. Topics with the same name become instances of one topic, in the order of the file.
fn topics(streams: Vec<Stream>, findings: Vec<Finding>, life: Option<String>) -> Topics {
    let mut out = Topics { life, findings, ..Topics::default() };
    out.findings.extend(streams.iter().filter_map(Stream::said).map(Finding::warning));
    let mut instances: BTreeMap<String, u16> = BTreeMap::new();
    for stream in streams {
        let next = instances.entry(stream.name.clone()).or_default();
        let key = (stream.name, *next);
        *next = next.saturating_add(1);
        out.counts.insert(key.clone(), stream.count);
        if let Some(topic) = stream.topic.filter(|t| t.last_s().is_some()) {
            out.topics.insert(key, topic);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_have_the_names_of_ulog_and_of_mavros() {
        let named = |topic: &str, kind: &str| {
            let (vehicle, name) = named(topic, kind);
            format!("{vehicle}|{name}")
        };
        assert_eq!(
            named("/fmu/out/vehicle_status_v1", "px4_msgs/msg/VehicleStatus"),
            "|vehicle_status"
        );
        assert_eq!(
            named("/px4_2/fmu/in/vehicle_attitude_setpoint", "px4_msgs/msg/X"),
            "px4_2|vehicle_attitude_setpoint"
        );
        assert_eq!(named("/mavros/imu/data", "sensor_msgs/msg/Imu"), "|imu/data");
        assert_eq!(named("/uav1/mavros/vfr_hud", "mavros_msgs/msg/VfrHud"), "uav1|vfr_hud");
        assert_eq!(named("/probe/alpha", "std_msgs/msg/Float64"), "|probe/alpha");
    }

    #[test]
    fn a_clock_that_is_set_in_flight_is_bridged() {
        let mut clock = Clock::default();
        let stamps = [(12.0, 0.1), (12.1, 0.2), (1700.3, 0.3), (1700.4, 0.4)];
        let times = stamps.map(|(stamp, log)| clock.time(stamp, log));
        for (time, exact) in times.iter().zip([12.0, 12.1, 12.2, 12.3]) {
            assert!((time - exact).abs() < 1e-9, "{times:?}");
        }
        assert_eq!(clock.jumps, 1);
    }
}
