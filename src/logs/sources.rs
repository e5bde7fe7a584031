//! Chooses which instance of each topic is read, and lists the other instances.
//!
//! A topic has several instances if, for example, a vehicle carries two pitot tubes, or if a VTOL has one controller for lift
//! and one for wing-borne flight. The reader takes the first instance whose fields change, unless the vehicle's type requires
//! another one. A finding (a message to the user) reports the choice.

use std::collections::BTreeMap;

use serde::Serialize;

use super::finding::Finding;
use super::mapping::rule::Rule;
use super::topics::{Naming, Topic, Topics, period_s};

/// Instance of a topic that the user requests: `--source airspeed=1`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asked {
    /// Name of the topic.
    pub topic: String,
    /// Number of the instance. In a MAVLink log it is system × 256 + component.
    pub instance: u16,
}

impl std::fmt::Display for Asked {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.topic, self.instance)
    }
}

impl std::str::FromStr for Asked {
    type Err = String;

    fn from_str(text: &str) -> Result<Asked, String> {
        let wrong = || {
            format!(
                "\"{text}\" is not TOPIC=INSTANCE, such as airspeed=1, or ATTITUDE=2/1 (system/component)"
            )
        };
        let (topic, instance) = text.split_once('=').ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse().ok();
        let instance = match instance.split_once('/') {
            None => instance.trim().parse::<u16>().map_err(|_| wrong())?,
            Some((system, component)) => {
                let both = number(system).zip(number(component)).ok_or_else(wrong)?;
                u16::from_be_bytes([both.0, both.1])
            }
        };
        Ok(Asked { topic: topic.trim().to_owned(), instance })
    }
}

/// One instance of a topic from which columns could be filled.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Source {
    /// Name of the topic.
    pub topic: String,
    /// The instance as it is written in a mapping file.
    pub instance: String,
    /// Sample rate from the median sample period, Hz.
    pub rate_hz: f64,
    /// Time of the first sample, s.
    pub from_s: f64,
    /// Time of the last sample, s.
    pub to_s: f64,
    /// Whether the value of any field changes. Only fields that fill columns are considered.
    pub moves: bool,
    /// Whether the reader uses this instance.
    pub read: bool,
}

/// The chosen instance of each topic, by the topic's name.
#[derive(Debug, Default)]
pub(super) struct Choice {
    read: BTreeMap<String, u16>,
    /// The instances that the user requested, by the topic's name.
    asked: BTreeMap<String, u16>,
    /// All instances of each topic that has more than one.
    pub sources: Vec<Source>,
    /// Findings about choices that the user should know.
    pub findings: Vec<Finding>,
}

impl Choice {
    /// Chooses an instance for each topic of `rules`. The instances that the user requested (`asked`) take
    /// precedence.
    pub fn of(topics: &Topics, rules: &[Rule], asked: &[Asked]) -> Choice {
        let mut choice = Choice::default();
        let mut names: Vec<&str> = rules.iter().map(|r| r.topic.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        for name in &names {
            choice.topic(topics, name, rules, asked);
        }
        choice.findings.extend(without_first(topics, &names, rules, asked));
        choice
    }

    /// The instance of the topic of `rule`: the one that the user requested, else that of the rule, else the chosen
    /// one.
    pub fn instance(&self, rule: &Rule) -> Option<u16> {
        let of = |all: &BTreeMap<String, u16>| all.get(&rule.topic).copied();
        of(&self.asked).or(rule.instance).or_else(|| of(&self.read))
    }

    fn topic(&mut self, topics: &Topics, name: &str, rules: &[Rule], asked: &[Asked]) {
        let of_topic: Vec<&Rule> = rules.iter().filter(|r| r.topic == name).collect();
        let all: Vec<(u16, &Topic)> = topics.instances(name).collect();
        let fields: Vec<&str> = of_topic.iter().flat_map(|r| r.fields()).collect();
        let moves = |topic: &Topic| fields.iter().any(|f| topic.moves(f));
        let named = asked.iter().find(|a| a.topic == name).map(|a| a.instance);
        let fixed = of_topic.iter().find_map(|r| r.instance);
        let preferred = of_topic.iter().find_map(|r| r.preferred);
        let there = |i: &u16| all.iter().any(|(instance, _)| instance == i);
        let alive = |i: &u16| all.iter().any(|(instance, t)| instance == i && moves(t));
        let usual = preferred.filter(there).or(all.first().map(|(i, _)| *i));
        let first_alive = || all.iter().find(|(_, t)| moves(t)).map(|(i, _)| *i);
        let read = named.or(fixed).or_else(|| usual.filter(alive).or_else(first_alive).or(usual));
        let Some(read) = read else { return };
        self.read.insert(name.to_owned(), read);
        self.asked.extend(named.map(|instance| (name.to_owned(), instance)));
        if let Some(named) = named.filter(|i| !there(i)) {
            let has: Vec<String> = all.iter().map(|(i, _)| topics.naming.written(*i)).collect();
            self.findings.push(Finding::problem(format!(
                "{name} has no instance {}; it has {}",
                topics.naming.written(named),
                if has.is_empty() { "none".to_owned() } else { has.join(", ") }
            )));
        }
        if all.len() < 2 {
            return;
        }
        let source = |(i, t): &(u16, &Topic)| Source {
            topic: name.to_owned(),
            instance: topics.naming.written(*i),
            rate_hz: Some(period_s(&t.time_s)).filter(|p| *p > 0.0).map_or(0.0, |p| 1.0 / p),
            from_s: t.time_s.first().copied().unwrap_or(0.0),
            to_s: t.time_s.last().copied().unwrap_or(0.0),
            moves: moves(t),
            read: *i == read,
        };
        let sources: Vec<Source> = all.iter().map(source).collect();
        if fixed.is_none() || named.is_some() {
            self.findings.extend(said(name, &sources, named.is_some()));
        }
        self.sources.extend(sources);
    }
}

/// Finding about the choice among the instances of the topic `name`. `None` if the user requested no instance, the first one
/// is read and no other one changes.
fn said(name: &str, sources: &[Source], asked: bool) -> Option<Finding> {
    let read = sources.iter().find(|s| s.read)?;
    let list = |of: &dyn Fn(&&Source) -> bool| -> Vec<&str> {
        sources.iter().filter(|s| !s.read).filter(|s| of(s)).map(|s| s.instance.as_str()).collect()
    };
    let (dead, others) = (list(&|s| !s.moves), list(&|s| s.moves));
    let instance = &read.instance;
    let other = others.first().map(|other| {
        format!("; {} moves too: --source {name}={other} reads it", others.join(", "))
    });
    let other = other.unwrap_or_default();
    // an absent or failed further sensor does not matter if the first one is read
    let usual = sources.first().is_some_and(|s| s.read);
    match (asked, dead.is_empty() || usual) {
        (true, _) => {
            Some(Finding::note(format!("{name}: instance {instance} is read, as asked{other}")))
        }
        (_, false) => Some(Finding::warning(format!(
            "{name}: instance {instance} is read, for {} never changes{other}",
            dead.join(", ")
        ))),
        (_, true) if others.is_empty() && usual => None,
        (_, true) => Some(Finding::note(format!("{name}: instance {instance} is read{other}"))),
    }
}

/// Finding about the topics of `names` that have no instance 0, unless the user or a rule states the instance that is read.
/// pymavlink 2.4.50's `mavlogdump --reduce 2` leaves out the first of two sensors (`findings/mavlogdump-thinned-sensors.sh`).
fn without_first(
    topics: &Topics,
    names: &[&str],
    rules: &[Rule],
    asked: &[Asked],
) -> Option<Finding> {
    if topics.naming != Naming::Number {
        return None;
    }
    let stated = |name: &str| {
        let by_rule = rules.iter().any(|r| r.topic == name && r.instance.is_some());
        by_rule || asked.iter().any(|a| a.topic == name)
    };
    let lacking = names.iter().filter(|name| !stated(name)).filter_map(|name| {
        let (first, _) = topics.instances(name).next()?;
        (first > 0).then(|| format!("{name} has instance {first} and no instance 0"))
    });
    let lacking: Vec<String> = lacking.collect();
    (!lacking.is_empty()).then(|| {
        Finding::note(format!(
            "{}: the first sensor is switched off, or the log was thinned (pymavlink's mavlogdump --reduce 2 leaves out the \
             first of two sensors); give a thinned log as it was recorded",
            lacking.join(", ")
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stretches::Keep;

    #[test]
    fn a_topic_without_its_first_instance_is_noted() {
        let said = |instances: &[u16], naming: Naming, asked: &[Asked]| {
            let mut topics = Topics { naming, ..Topics::default() };
            for instance in instances {
                let mut topic = Topic::new(["GyrX"], Keep::All);
                (0..3).for_each(|k| topic.push(f64::from(k), &[f64::from(k)]));
                topics.topics.insert(("IMU".to_owned(), *instance), topic);
            }
            let rules = [Rule::linear("p_radps", "IMU", "GyrX", 1.0)];
            let choice = Choice::of(&topics, &rules, asked);
            let texts = choice.findings.iter().map(|f| f.text.as_str());
            texts.collect::<Vec<_>>().join("; ").contains("has instance 1 and no instance 0")
        };
        assert!(said(&[1], Naming::Number, &[]) && said(&[1, 2], Naming::Number, &[]));
        assert!(!said(&[0], Naming::Number, &[]) && !said(&[0, 1], Naming::Number, &[]));
        // the instance of a MAVLink log is its sender, and what the user asked for is known to the user
        assert!(!said(&[1], Naming::Sender, &[]));
        assert!(!said(&[1], Naming::Number, &[Asked { topic: "IMU".into(), instance: 1 }]));
    }

    #[test]
    fn an_instance_that_is_asked_for_is_read_though_the_rule_names_another_one() {
        let mut topics = Topics::default();
        for instance in [1, 2] {
            let mut topic = Topic::new(["roll"], Keep::All);
            (0..3).for_each(|k| topic.push(f64::from(k), &[f64::from(k)]));
            topics.topics.insert(("ATTITUDE".to_owned(), instance), topic);
        }
        let rules = [Rule::linear("roll_rad", "ATTITUDE", "roll", 1.0).of(Some(1))];
        let asked = [Asked { topic: "ATTITUDE".into(), instance: 2 }];
        let read = |asked: &[Asked]| Choice::of(&topics, &rules, asked).instance(&rules[0]);
        assert_eq!((read(&[]), read(&asked)), (Some(1), Some(2)));
        let choice = Choice::of(&topics, &rules, &asked);
        assert!(choice.findings[0].text.contains("instance 2 is read, as asked"));
    }
}
