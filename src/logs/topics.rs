//! Content of a binary log: topics with numeric fields over time.

use std::collections::BTreeMap;

use super::finding::Finding;

/// One instance of a topic, stored field by field.
#[derive(Clone, Debug, Default)]
pub(super) struct Topic {
    /// Times of the samples, s.
    pub time_s: Vec<f64>,
    /// Names of the fields.
    pub fields: Vec<String>,
    /// The fields' values, in the order of `fields`, each as long as `time_s`.
    pub values: Vec<Vec<f64>>,
}

impl Topic {
    /// A topic without samples.
    pub fn new<S: Into<String>>(fields: impl IntoIterator<Item = S>) -> Self {
        let fields: Vec<String> = fields.into_iter().map(Into::into).collect();
        let values = vec![Vec::new(); fields.len()];
        Topic { time_s: Vec::new(), fields, values }
    }

    /// Whether a field exists and has at least two finite values.
    pub fn moves(&self, name: &str) -> bool {
        let Some(values) = self.field(name) else { return false };
        let mut finite = values.iter().filter(|x| x.is_finite());
        let first = finite.next();
        first.is_some_and(|first| finite.any(|x| x != first))
    }

    /// The values of a field.
    pub fn field(&self, name: &str) -> Option<&[f64]> {
        let i = self.fields.iter().position(|f| f == name)?;
        Some(&self.values[i])
    }
}

/// The median time between samples, s; 0 for fewer than two.
pub(super) fn period_s(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> =
        times.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0 && d.is_finite()).collect();
    if steps.is_empty() {
        return 0.0;
    }
    let middle = steps.len() / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// How the instances of a topic are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Naming {
    /// By a number from 0 on.
    #[default]
    Number,
    /// MAVLink's system/component, of which the number is system × 256 + component.
    Sender,
}

impl Naming {
    /// An instance as it is written in a mapping.
    pub fn written(self, instance: u16) -> String {
        let [system, component] = instance.to_be_bytes();
        match self {
            Naming::Number => instance.to_string(),
            Naming::Sender => format!("{system}/{component}"),
        }
    }
}

/// The content of a binary log, or of one life of a vehicle in it.
#[derive(Clone, Debug, Default)]
pub(super) struct Topics {
    /// Vehicle and boot of this flight, where the file holds several.
    pub life: Option<String>,
    /// The MAVLink system whose life it is.
    pub system: Option<u8>,
    /// How instances are written.
    pub naming: Naming,
    /// Name and version of the firmware; empty if the log has none.
    pub firmware: String,
    /// The requested topics, by name with instance.
    pub topics: BTreeMap<(String, u16), Topic>,
    /// Number of records of each topic of the file, requested or not.
    pub counts: BTreeMap<(String, u16), usize>,
    /// Parameters of the vehicle; the last value of each.
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

    /// A field of the first instance of a topic, with its times.
    pub fn series(&self, name: &str, field: &str) -> Option<(&[f64], &[f64])> {
        let topic = self.first(name)?;
        Some((&topic.time_s, topic.field(field)?))
    }

    /// Whether the records are those of sdlog2, the log of PX4 before ULog: of the form of DataFlash, one record for the
    /// time of all.
    pub fn of_sdlog2(&self) -> bool {
        let has = |name: &str| self.counts.contains_key(&(name.to_owned(), 0));
        self.topics.is_empty() && has("TIME") && has("STAT") && has("ATT")
    }

    /// The last value of a parameter.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.get(name).copied()
    }
}
