//! Mapping from the topics of a log to the columns of the table. A topic is a kind of message or record.
//!
//! For each binary format there are built-in rules in order of preference. A mapping file replaces them for single columns:
//!
//! ```toml
//! schema = 1
//! [columns]
//! airspeed_mps = { from = "VFR_HUD.airspeed", scale = 0.514444 }  # logged in knots
//! alpha_rad = { from = "AOA_SSA.AOA", scale = 0.0174533, offset = -0.02, instance = "1/200" }
//! roll_rad = { from = "csv.roll_deg", scale = 0.0174533 }         # another column of a CSV
//! ```
//!
//! `[attitude] quaternion = ["csv.qx", "csv.qy", "csv.qz", "csv.qw"]` derives roll, pitch and yaw from a quaternion
//! of earth axes NED to body axes FRD; `order = "wxyz"` or `"xyzw"` states whether w is first or last.
//!
//! A column's value is scale × field + offset. `instance` selects one of several sources of a topic: by its number (ULog,
//! DataFlash, ROS bag) or by system/component (telemetry log). With `rate_over_s` the column is the rate of change of the field:
//! the slope of a cubic fitted to the rows within that many seconds. `[derive] body_rates_over_s` computes p, q, r from roll,
//! pitch and yaw in the same way. `[board]` rotates the axes of a log, see [`Board`]. `[sensors]` describes sensors and wind, see
//! [`Sensors`].
//!
//! `[flight]` states when the aircraft counts as flying: above the airspeed `from_mps`. If a model is given, the limit in its
//! envelope takes precedence. `shortest_s` (at least 0.5 s) is the shortest flight time with which a log is used.

mod ardupilot;
mod board;
mod mavros;
pub(crate) mod telemetry;
mod px4;
pub(super) mod rule;
mod servos;
mod written;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::csv::Order;
use super::derive;
use super::format::Format;
use super::phases::Flying;
use super::topics::Topics;
pub use board::Board;
use greylag_physics::Sensors;
use greylag_physics::mixer::Mixer;
use greylag_physics::sensors::CONSTANTS;
use rule::{Fill, Rule, Shape, Term};
use written::{Written, WrittenFlight, entry, over, thresholds, turn};

/// Topic name of the columns of a CSV file in a mapping.
pub const TEXT: &str = "csv";

/// Why a mapping file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MappingError {
    /// The file cannot be read.
    #[error("cannot read mapping {}: {source}: check the path", path.display())]
    File {
        /// Path of the mapping file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The text is not a mapping.
    #[error("mapping {}: {text}", path.display())]
    Text {
        /// Path of the mapping file.
        path: PathBuf,
        /// Error of the content.
        text: String,
    },
}

/// Source of a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Name of the topic.
    pub topic: String,
    /// Name of the field in the topic.
    pub field: String,
    /// Factor that converts the field to the column's unit.
    pub scale: f64,
    /// Constant that is added to the scaled field, in the column's unit.
    pub offset: f64,
    /// The instance of the topic; `None` if the reader of the log chooses it.
    pub instance: Option<u16>,
    /// If the column is the rate of change of the field: time span of the fitted cubic, s. Otherwise `None`.
    pub rate_over_s: Option<f64>,
}

impl Entry {
    /// The entry for the field `field` of `topic` times `scale`.
    pub(super) fn scaled(topic: &str, field: &str, scale: f64) -> Entry {
        let (topic, field) = (topic.to_owned(), field.to_owned());
        Entry { topic, field, scale, offset: 0.0, instance: None, rate_over_s: None }
    }

    /// The entry that fills a column as `rule` does from the instance `instance` of its topic. `None` if the rule does more than
    /// scale one field and add a constant.
    pub(super) fn of(rule: &Rule, instance: u16) -> Option<Entry> {
        let Fill::Sum { terms, offset, .. } = &rule.fill else { return None };
        let [Term { field, gain, shape: Shape::Linear }] = &terms[..] else { return None };
        let instance = (instance != 0).then_some(instance);
        Some(Entry { offset: *offset, instance, ..Entry::scaled(&rule.topic, field, *gain) })
    }

    /// Text of the entry in a mapping file for logs of `format`, with the column multiplied by `factor`.
    pub fn times(&self, factor: f64, format: Format) -> String {
        self.corrected(factor, 0.0, format)
    }

    /// The same text, with `more` (in the column's unit) added to the multiplied column.
    pub fn corrected(&self, factor: f64, more: f64, format: Format) -> String {
        let offset = self.offset * factor + more;
        let from = toml::Value::from(format!("{}.{}", self.topic, self.field));
        let mut text = format!("{{ from = {from}, scale = {}", self.scale * factor);
        if offset != 0.0 {
            text += &format!(", offset = {offset}");
        }
        text += &match self.instance.map(|instance| (instance.to_be_bytes(), instance)) {
            None => String::new(),
            Some(([system, component], _)) if format == Format::Tlog => {
                format!(", instance = \"{system}/{component}\"")
            }
            Some((_, number)) => format!(", instance = {number}"),
        };
        if let Some(time) = self.rate_over_s {
            text += &format!(", rate_over_s = {time}");
        }
        text + " }"
    }
}

/// A user's mapping, with the mixer that assigns the autopilot's outputs to surfaces and motors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    /// Source of each mapped column.
    entries: BTreeMap<String, Entry>,
    /// Time span over which the attitude is differentiated to give body rates, s.
    body_rates_over_s: Option<f64>,
    /// Prior information on sensors and wind.
    sensors: Sensors,
    /// Source of the attitude, if the mapping names a quaternion.
    quaternion: Option<Turn>,
    /// Orientation of the log's axes relative to the body axes.
    board: Option<Board>,
    /// Criteria by which the aircraft counts as flying.
    flight: WrittenFlight,
    /// The mixer of the aircraft.
    mixer: Option<Mixer>,
}

/// Source of the attitude as a quaternion, which rotates earth axes (NED) to body axes (FRD).
#[derive(Clone, Debug, PartialEq)]
pub struct Turn {
    /// Name of the topic.
    pub topic: String,
    /// Names of the fields of the four components, in the order of the mapping file.
    pub fields: [String; 4],
    /// Order of the components. If it is `None`, the order in a CSV table is found from body rates and gravity; in
    /// other formats it is wxyz.
    pub order: Option<Order>,
}

impl Mapping {
    /// Reads a mapping file.
    ///
    /// # Errors
    /// The file cannot be read, or is not a mapping.
    pub fn load(path: &Path) -> Result<Mapping, MappingError> {
        let text = greylag_physics::text_file::read(path)
            .map_err(|source| MappingError::File { path: path.to_owned(), source })?;
        Mapping::parse(&text, path)
    }

    /// Reads a mapping from text; `path` appears in errors.
    ///
    /// # Errors
    /// The text is not a mapping.
    pub fn parse(text: &str, path: &Path) -> Result<Mapping, MappingError> {
        let wrong = |text: String| MappingError::Text { path: path.to_owned(), text };
        let written: Written = toml::from_str(text).map_err(|e| wrong(e.to_string()))?;
        if written.schema != 1 {
            return Err(wrong(format!("schema {} is not known; write schema = 1", written.schema)));
        }
        let mut entries = BTreeMap::new();
        for (column, e) in written.columns {
            let entry = entry(&column, e).map_err(wrong)?;
            entries.insert(column, entry);
        }
        let body_rates_over_s = written.derive.body_rates_over_s;
        over("derive.body_rates_over_s", body_rates_over_s).map_err(wrong)?;
        let mut sensors = written.sensors;
        if body_rates_over_s.is_some() {
            // rates differentiated from the attitude have no bias relative to it
            let gyros = CONSTANTS.iter().filter(|(name, _)| name.starts_with("gyro_"));
            gyros.for_each(|(name, _)| sensors.hold(name, 0.0));
        }
        let quaternion = written.attitude.map(turn).transpose().map_err(wrong)?;
        let board = written.board.map(Board::try_from).transpose().map_err(wrong)?;
        let flight = thresholds(written.flight).map_err(wrong)?;
        Ok(Mapping { entries, body_rates_over_s, sensors, quaternion, board, flight, mixer: None })
    }

    /// Orientation of the log's axes relative to the body axes, if the mapping has a section `[board]`.
    pub(super) fn board(&self) -> Option<&Board> {
        self.board.as_ref()
    }

    /// Criteria by which the aircraft counts as flying: those of the model (`model`) if there is one, else those of the mapping,
    /// else the default ones. A `shortest_s` in the mapping applies in every case.
    pub fn flies(&self, model: Option<Flying>) -> Flying {
        let mut flies = model.unwrap_or_else(|| match self.flight.from_mps {
            Some(from) => Flying::from(from),
            None => Flying::default(),
        });
        if let Some(shortest) = self.flight.shortest_s {
            flies.sustained_s = flies.sustained_s.min(shortest);
            flies.shortest_s = shortest;
        }
        flies
    }

    /// Whether any column is computed as the rate of change of others.
    pub(super) fn derives(&self) -> bool {
        self.body_rates_over_s.is_some() || self.slopes().next().is_some()
    }

    /// Prior information on sensors and wind.
    pub fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// Time span over which the attitude is differentiated to give body rates, s.
    pub(super) fn body_rates_over_s(&self) -> Option<f64> {
        self.body_rates_over_s
    }

    /// The columns that are rates of change of a field, each with the time span of the fitted cubic, s.
    pub(super) fn slopes(&self) -> impl Iterator<Item = (&str, f64)> {
        self.entries.iter().filter_map(|(column, e)| Some((column.as_str(), e.rate_over_s?)))
    }

    /// Text that names the source of a column of a CSV table: a column of the file, or what it is computed from. `entry` is the
    /// column's entry if a single column of the file fills it.
    pub(super) fn origin(&self, column: &str, entry: Option<&Entry>) -> String {
        match entry {
            Some(e) if e.rate_over_s.is_some() => format!("rate of {}", e.field),
            Some(e) => e.field.clone(),
            None if self.makes(column) && derive::RATES.contains(&column) => "attitude".into(),
            None if self.makes(column) && self.get("vn_mps").is_some() => "velocity, wind".into(),
            None => column.to_owned(),
        }
    }

    /// Whether `column` is computed from other columns if the log lacks it.
    pub(super) fn makes(&self, column: &str) -> bool {
        match column {
            derive::AIRSPEED => self.sensors.wind().is_some() && self.get(column).is_none(),
            _ => self.body_rates_over_s.is_some() && derive::RATES.contains(&column),
        }
    }

    /// Sets the mixer of the airframe, by which logged outputs of the autopilot become columns of surfaces and motors.
    pub fn with_mixer(self, mixer: Option<Mixer>) -> Mapping {
        Mapping { mixer, ..self }
    }

    /// Source of the attitude as a quaternion, if the mapping has one.
    pub(super) fn quaternion(&self) -> Option<&Turn> {
        self.quaternion.as_ref()
    }

    /// The mixer of the aircraft.
    pub(super) fn mixer(&self) -> Option<&Mixer> {
        self.mixer.as_ref()
    }

    /// The entry for `column`, if the mapping has one.
    pub fn get(&self, column: &str) -> Option<&Entry> {
        self.entries.get(column)
    }

    /// The `entries` of a log's columns, with those of the mapping in place of the reader's own.
    pub(super) fn over(&self, mut entries: BTreeMap<String, Entry>) -> BTreeMap<String, Entry> {
        for (column, entry) in &mut entries {
            if let Some(own) = self.get(column) {
                entry.clone_from(own);
            }
        }
        entries
    }

    /// The entries of a topic, with their columns.
    pub fn of_topic<'a>(&'a self, topic: &'a str) -> impl Iterator<Item = (&'a str, &'a Entry)> {
        self.entries
            .iter()
            .filter(move |(_, e)| e.topic == topic)
            .map(|(column, e)| (column.as_str(), e))
    }

    /// Whether the mapping file names the topic `topic`.
    pub(super) fn uses(&self, topic: &str) -> bool {
        let turn = self.quaternion.as_ref().is_some_and(|q| q.topic == topic);
        turn || self.entries.values().any(|e| e.topic == topic)
    }

    /// The rules of the mapping file, then the built-in rules of the format for the remaining columns.
    pub(super) fn rules(&self, format: Format, topics: &Topics) -> Vec<Rule> {
        let own = self.entries.iter().map(|(column, e)| {
            Rule::linear(column, &e.topic, &e.field, e.scale).plus(e.offset).of(e.instance).own()
        });
        let others = match format {
            Format::Csv => Vec::new(),
            Format::Ulog => px4::rules(topics),
            // the time stamps of px4_msgs and MAVROS come from different clocks, so only one of the two is used
            Format::Ros if topics.first("vehicle_attitude").is_some() => px4::rules(topics),
            Format::Ros => mavros::rules(topics, self.mixer()),
            Format::Dataflash => ardupilot::rules(topics, self.mixer()),
            Format::Tlog => telemetry::rules(topics, self.mixer()),
        };
        let turn = self.quaternion.as_ref().map(|q| {
            let [a, b, c, d] = q.fields.each_ref().map(String::as_str);
            let fields = match q.order {
                Some(Order::Xyzw) => [d, a, b, c],
                _ => [a, b, c, d],
            };
            Rule::quaternion(&q.topic, fields).own()
        });
        let turned = |c: &str| turn.as_ref().is_some_and(|rule| rule.columns().contains(&c));
        let taken = |c: &str| self.entries.contains_key(c) || turned(c);
        let free: Vec<Rule> = others.into_iter().filter_map(|rule| rule.without(taken)).collect();
        own.chain(turn.clone()).chain(free).collect()
    }

    /// Whether any rule needs the field `field` of the topic `topic` of a ULog or a ROS bag. An empty name means any field.
    pub(super) fn wants_field(&self, format: Format, topic: &str, field: &str) -> bool {
        if field.is_empty() {
            return self.wants(format, topic);
        }
        let entry = || self.entries.values().any(|e| e.topic == topic && e.field == field);
        let turn = || {
            let of_topic = self.quaternion.as_ref().filter(|q| q.topic == topic);
            of_topic.is_some_and(|q| q.fields.iter().any(|f| f == field))
        };
        let own = px4::TOPICS.contains(&topic) && px4::uses(field);
        let ros = || mavros::TOPICS.contains(&topic) && mavros::uses(field);
        own || format == Format::Ros && ros() || entry() || turn()
    }

    /// Whether any rule for `format` needs the topic `topic`.
    pub(super) fn wants(&self, format: Format, topic: &str) -> bool {
        let own: &[&str] = match format {
            Format::Csv => &[],
            Format::Ulog => &px4::TOPICS,
            Format::Ros if mavros::TOPICS.contains(&topic) => &mavros::TOPICS,
            Format::Ros => &px4::TOPICS,
            Format::Dataflash => &ardupilot::TOPICS,
            Format::Tlog => &telemetry::TOPICS,
        };
        own.contains(&topic) || self.uses(topic)
    }
}

/// The rules for a CSV table whose columns are named by record or message and field, such as `ATT.Roll`.
pub(super) fn table_rules() -> Vec<Rule> {
    let of_dataflash = ardupilot::rules(&Topics::default(), None);
    of_dataflash.into_iter().chain(telemetry::of_table()).collect()
}
