//! Content of a binary log: topics (message or record types) whose numeric fields are time series. A topic has several instances
//! if, for example, there are several sensors of a kind.

use std::collections::BTreeMap;

use super::finding::Finding;
use super::stretches::{Keep, Level, MOST, Watch};

/// One instance of a topic, stored field by field.
#[derive(Clone, Debug, Default)]
pub(super) struct Topic {
    /// Times of the samples, s.
    pub time_s: Vec<f64>,
    /// Names of the fields.
    pub fields: Vec<String>,
    /// The fields' values, in the order of `fields`, each as long as `time_s`.
    pub values: Vec<Vec<f64>>,
    /// Selection of the kept stretches (intervals of 30 s) of the topic.
    pub level: Level,
    /// Statistics of all samples, kept or not; `None` if the log is read with `Keep::All`.
    pub watch: Option<Box<Watch>>,
}

impl Topic {
    /// A topic without samples.
    pub fn new<S: Into<String>>(fields: impl IntoIterator<Item = S>, keep: Keep) -> Self {
        let fields: Vec<String> = fields.into_iter().map(Into::into).collect();
        let values = vec![Vec::new(); fields.len()];
        let watch = (keep == Keep::Stretches).then(Box::default);
        Topic { fields, values, watch, ..Topic::default() }
    }

    /// Adds a sample at `time_s` (s). `values` are in the order of `fields`.
    pub fn push(&mut self, time_s: f64, values: &[f64]) {
        if let Some(watch) = &mut self.watch {
            watch.take(time_s, values);
            watch.coarsely(time_s, values);
            if self.level.thins() && !self.level.keeps(time_s) {
                return;
            }
        }
        self.time_s.push(time_s);
        self.values.iter_mut().zip(values).for_each(|(column, x)| column.push(*x));
        if self.watch.is_some() && self.time_s.len() > MOST {
            self.level.halved().into_iter().for_each(|level| self.thin(level));
        }
    }

    /// Time of the last sample, kept or not, s.
    pub fn last_s(&self) -> Option<f64> {
        let watched = self.watch.as_ref().and_then(|watch| watch.span_s).map(|(_, last)| last);
        watched.filter(|_| self.level.thins()).or(self.time_s.last().copied())
    }

    /// Drops the samples outside the stretches that `level` keeps.
    fn thin(&mut self, level: Level) {
        self.level = level;
        let mut kept = 0;
        for i in 0..self.time_s.len() {
            if level.keeps(self.time_s[i]) {
                self.time_s[kept] = self.time_s[i];
                self.values.iter_mut().for_each(|column| column[kept] = column[i]);
                kept += 1;
            }
        }
        self.time_s.truncate(kept);
        self.values.iter_mut().for_each(|column| column.truncate(kept));
    }

    /// One sample per second throughout the log; `None` if all samples of the topic are kept.
    pub fn coarse(&self) -> Option<Topic> {
        let watch = self.watch.as_ref().filter(|_| self.level.thins())?;
        let (time_s, values) = (watch.coarse_s.clone(), watch.coarse.clone());
        Some(Topic { time_s, values, fields: self.fields.clone(), ..Topic::default() })
    }

    /// Whether the field `name` exists and has at least two different finite values.
    pub fn moves(&self, name: &str) -> bool {
        let Some(values) = self.field(name) else { return false };
        let mut finite = values.iter().filter(|x| x.is_finite());
        let first = finite.next();
        first.is_some_and(|first| finite.any(|x| x != first))
    }

    /// The index of a field in `fields`.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.fields.iter().position(|f| f == name)
    }

    /// The values of a field.
    pub fn field(&self, name: &str) -> Option<&[f64]> {
        self.place(name).map(|i| &self.values[i][..])
    }
}

/// The median time between samples, s; 0 for fewer than two samples.
pub(super) fn period_s(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> =
        times.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0 && d.is_finite()).collect();
    if steps.is_empty() {
        return 0.0;
    }
    let middle = steps.len() / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// How the instances of a topic are named in texts and mappings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Naming {
    /// By a number from 0 on.
    #[default]
    Number,
    /// By the MAVLink sender, as `system/component`. The number of the instance is system × 256 + component.
    Sender,
}

impl Naming {
    /// Name of an instance in texts and mappings.
    pub fn written(self, instance: u16) -> String {
        let [system, component] = instance.to_be_bytes();
        match self {
            Naming::Number => instance.to_string(),
            Naming::Sender => format!("{system}/{component}"),
        }
    }
}

/// Largest number of flights that are read from one file. Each flight has a copy of the parameters. Without this limit, the
/// thousands of apparent restarts in a damaged file would use up the memory.
pub(super) const MOST_FLIGHTS: usize = 200;

/// Finding about a file with more than [`MOST_FLIGHTS`] flights.
pub(super) fn too_many() -> Finding {
    Finding::warning(format!(
        "the clock of the file starts again more often than a log's does: the first {MOST_FLIGHTS} flights are read, the others left out"
    ))
}

/// The content of a binary log. If the log contains several flights (boots or vehicles), it is the content of one of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Topics {
    /// Text that names vehicle and boot of this flight; `None` unless the file contains several flights.
    pub life: Option<String>,
    /// The MAVLink system of this flight; `None` in other formats.
    pub system: Option<u8>,
    /// How instances are named.
    pub naming: Naming,
    /// Name and version of the firmware; empty if the log has none.
    pub firmware: String,
    /// The requested topics, by name and instance.
    pub topics: BTreeMap<(String, u16), Topic>,
    /// Number of records of each topic of the file, requested or not.
    pub counts: BTreeMap<(String, u16), usize>,
    /// Last value of each parameter of the vehicle, by name.
    pub parameters: BTreeMap<String, f64>,
    /// Findings about the file.
    pub findings: Vec<Finding>,
}

impl Topics {
    /// The instances of a topic.
    pub fn instances(&self, name: &str) -> impl Iterator<Item = (u16, &Topic)> {
        let from = (name.to_owned(), 0);
        let until = (name.to_owned(), u16::MAX);
        self.topics.range(from..=until).map(|((_, instance), topic)| (*instance, topic))
    }

    /// The first instance of a topic.
    pub fn first(&self, name: &str) -> Option<&Topic> {
        self.instances(name).next().map(|(_, topic)| topic)
    }

    /// The times (s) and the values of a field in the first instance of a topic.
    pub fn series(&self, name: &str, field: &str) -> Option<(&[f64], &[f64])> {
        let topic = self.first(name)?;
        Some((&topic.time_s, topic.field(field)?))
    }

    /// Whether the log is an sdlog2 log, PX4's format before ULog. Its records look like DataFlash records, but a
    /// record of type TIME holds the time of all others.
    pub fn of_sdlog2(&self) -> bool {
        let has = |name: &str| self.counts.contains_key(&(name.to_owned(), 0));
        self.topics.is_empty() && has("TIME") && has("STAT") && has("ATT")
    }

    /// Drops stretches until all topics of which only stretches are kept have the same ones. Then frees unused memory.
    pub fn align(&mut self) {
        let level = self.topics.values().fold(Level::default(), |l, t| l.sparser(t.level));
        let fast = self.topics.values_mut().filter(|t| t.level.thins() && t.level != level);
        fast.for_each(|topic| topic.thin(level));
        for topic in self.topics.values_mut().filter(|t| t.level.thins()) {
            topic.time_s.shrink_to_fit();
            topic.values.iter_mut().for_each(Vec::shrink_to_fit);
        }
    }

    /// The last value of a parameter.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.get(name).copied()
    }
}
