//! The flight controller's parameters, which are read one by one and checked against the rules of a profile.
//!
//! A profile belongs to one autopilot firmware and one kind of command, surfaces or attitudes. Its rules state the allowed
//! values of each parameter (`profile.rs`).

use std::time::Duration;

use super::profile::{Matters, Need, Presence, Rule};

/// Interval between requests for the same parameter.
const AGAIN: Duration = Duration::from_millis(400);
/// Largest number of requests per call. The limit spreads the requests over several calls, because the link may be slow.
const AT_ONCE: usize = 4;
/// Number of requests for one name after which the controller counts as lacking the parameter.
const TRIES: u32 = 5;
/// Valid pulse widths of a channel, µs.
pub(super) const PULSE: std::ops::RangeInclusive<f64> = 800.0..=2200.0;

/// Longest text about violations, characters. With its introduction it fits into the longest text that is sent to a client, for
/// example a ground station.
const LONGEST: usize = 330;

/// A rule, and what is known about its parameter.
#[derive(Clone, Copy, Debug)]
struct Entry {
    rule: &'static Rule,
    value: Option<(usize, f64)>,
    tries: u32,
    asked: Option<Duration>,
}

/// The parameters of a profile, as reported by the controller.
#[derive(Clone, Debug)]
pub struct Parameters {
    entries: Vec<Entry>,
}

/// Check result of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Standing {
    /// The controller has not reported it yet.
    Unread,
    /// The controller does not reply to requests for it, although the rule requires it.
    Unknown,
    /// The firmware lacks it, which the rule allows.
    Absent,
    /// The value fits the rule.
    Good(f64),
    /// The value violates the rule.
    Bad(f64),
}

impl Parameters {
    pub(super) fn new(rules: &'static [Rule]) -> Self {
        let entry = |rule| Entry { rule, value: None, tries: 0, asked: None };
        Parameters { entries: rules.iter().map(entry).collect() }
    }

    /// Clears the reported values, for instance after a restart of the controller.
    pub(super) fn forget(&mut self) {
        for entry in &mut self.entries {
            (entry.value, entry.tries, entry.asked) = (None, 0, None);
        }
    }

    /// Names of the parameters to request at `host`.
    pub(super) fn due(&mut self, host: Duration) -> Vec<&'static str> {
        let mut names = Vec::new();
        for entry in &mut self.entries {
            let waits = entry.asked.is_some_and(|asked| host.saturating_sub(asked) < AGAIN);
            let limit = TRIES * entry.rule.names.len() as u32;
            if entry.value.is_some() || waits || entry.tries >= limit || names.len() >= AT_ONCE {
                continue;
            }
            let turn = entry.tries as usize % entry.rule.names.len();
            entry.tries += 1;
            entry.asked = Some(host);
            names.push(entry.rule.names[turn]);
        }
        names
    }

    /// Stores a reported value. Parameters outside the rules are ignored. A value that is not finite is ignored as
    /// well: the last finite value stays, or the parameter stays unread.
    pub(super) fn take(&mut self, name: &str, value: f64) {
        if !value.is_finite() {
            return;
        }
        for entry in &mut self.entries {
            if let Some(at) = entry.rule.names.iter().position(|known| *known == name) {
                entry.value = Some((at, value));
            }
        }
    }

    /// Whether all parameters were requested and none was reported.
    pub(super) fn is_silent(&self) -> bool {
        self.entries.iter().all(|entry| entry.value.is_none() && entry.tries > 0)
    }

    /// The value of a parameter; `None` before it is reported.
    pub(super) fn get(&self, name: &str) -> Option<f64> {
        let entry = self.entries.iter().find(|entry| entry.rule.names.contains(&name))?;
        entry.value.map(|(_, value)| value)
    }

    /// Each relevant parameter under the name that the controller uses, with its check result and a text, which names
    /// the remedy of a violation. `radio` is whether the controller receives an RC transmitter.
    pub fn report(&self, system: u8, radio: bool) -> Vec<(&'static str, Standing, String)> {
        let matters = |entry: &&Entry| radio || entry.rule.matters == Matters::Always;
        self.entries.iter().filter(matters).map(|entry| entry.report(system)).collect()
    }

    /// Reason why the profile cannot be used with these parameters: each violation with its remedy. `None` if all parameters
    /// fit the rules.
    pub(super) fn obstacle(&self, system: u8, radio: bool) -> Option<String> {
        let report = self.report(system, radio);
        let unread = report.iter().filter(|(_, standing, _)| *standing == Standing::Unread).count();
        if unread > 0 {
            return Some(format!("still reading {unread} parameters from the controller"));
        }
        let bad: Vec<String> = report
            .into_iter()
            .filter(|(_, standing, _)| matches!(standing, Standing::Bad(_) | Standing::Unknown))
            .map(|(.., words)| words)
            .chain((1..=3).filter_map(|number| self.disorder(number)))
            .collect();
        (!bad.is_empty()).then(|| joined(&bad))
    }

    /// Text about a channel whose RCn_MIN, RCn_TRIM and RCn_MAX are each valid, but not in this order; `None` for a
    /// channel in order, or one without these parameters. The trim of the throttle channel is not read.
    fn disorder(&self, number: usize) -> Option<String> {
        let read =
            |name: &str| self.get(&format!("RC{number}_{name}")).filter(|x| PULSE.contains(x));
        let (low, high) = (read("MIN")?, read("MAX")?);
        let trim = read("TRIM").unwrap_or(low);
        if low < high && (low..=high).contains(&trim) {
            return None;
        }
        let named = read("TRIM").map_or(String::new(), |trim| format!(", RC{number}_TRIM {trim}"));
        Some(format!(
            "RC{number}_MIN {low}{named}, RC{number}_MAX {high} are not in ascending order: \
             calibrate channel {number} again"
        ))
    }
}

/// Joins the texts up to [`LONGEST`] characters. The first text is always included. The texts that do not fit are
/// counted.
fn joined(texts: &[String]) -> String {
    let mut words = String::new();
    for (at, text) in texts.iter().enumerate() {
        if at > 0 && words.chars().count() + text.chars().count() > LONGEST {
            return format!("{words}; and {} more: see `greylag link check`", texts.len() - at);
        }
        let between = if at > 0 { "; " } else { "" };
        words += &format!("{between}{text}");
    }
    words
}

impl Entry {
    fn standing(&self, system: u8) -> Standing {
        let limit = TRIES * self.rule.names.len() as u32;
        match (self.value, self.rule.presence) {
            (None, Presence::Optional) if self.tries >= limit => Standing::Absent,
            (None, _) if self.tries >= limit => Standing::Unknown,
            (None, _) => Standing::Unread,
            (Some((_, value)), _) if self.rule.need.allows(value, system) => Standing::Good(value),
            (Some((_, value)), _) => Standing::Bad(value),
        }
    }

    fn report(&self, system: u8) -> (&'static str, Standing, String) {
        let name = self.rule.names[self.value.map_or(0, |(at, _)| at)];
        let remedy = match (self.rule.need, self.value) {
            (Need::OurSystem, _) => f64::from(system),
            (Need::Without(bits), Some((_, value))) => f64::from(value as u32 & !bits),
            _ => self.rule.remedy,
        };
        let standing = self.standing(system);
        let words = match standing {
            Standing::Good(value) => format!("{name} is {value}"),
            Standing::Bad(value) => {
                format!("{name} is {value}: set it to {remedy} ({})", self.rule.why)
            }
            Standing::Unread => format!("{name} is not read yet"),
            Standing::Absent => format!("{name} is not in this firmware"),
            Standing::Unknown => format!(
                "{name} is unknown to the controller: its firmware is not one that this profile fits"
            ),
        };
        (name, standing, words)
    }
}

impl Need {
    /// Whether the rule allows this value for a controller with the system id `system`.
    pub fn allows(self, value: f64, system: u8) -> bool {
        match self {
            Need::OneOf(values) => values.contains(&value),
            Need::Between(low, high) => (low - 1e-6..=high + 1e-6).contains(&value),
            Need::OurSystem => value == f64::from(system),
            Need::Pulse => PULSE.contains(&value),
            Need::Without(bits) => value >= 0.0 && value as u32 & bits == 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::profile::{Authority, Stack};
    use super::*;

    fn answered(change: impl Fn(&str) -> Option<f64>) -> Parameters {
        let mut parameters = Parameters::new(Stack::Ardupilot.rules(Authority::Surfaces));
        for step in 0..100 {
            for name in parameters.due(AGAIN * step) {
                let rule = Stack::Ardupilot.rules(Authority::Surfaces);
                let rule = rule.iter().find(|rule| rule.names.contains(&name)).unwrap();
                if let Some(value) =
                    change(name).or((name != "MAV_GCS_SYSID").then_some(rule.remedy))
                {
                    parameters.take(name, value);
                }
            }
        }
        parameters
    }

    #[test]
    fn the_remedies_themselves_are_accepted_by_an_older_name_too() {
        let parameters = answered(|_| None);
        assert_eq!(parameters.obstacle(1, false), None);
        assert_eq!(parameters.get("MAV_GCS_SYSID"), Some(1.0));
    }

    #[test]
    fn a_mismatch_is_said_with_the_value_to_set() {
        let parameters = answered(|name| (name == "RC_OVERRIDE_TIME").then_some(3.0));
        let words = parameters.obstacle(1, false).unwrap();
        assert!(words.contains("RC_OVERRIDE_TIME is 3: set it to 0.5"), "{words}");
        let words = parameters.obstacle(7, false).unwrap();
        assert!(words.contains("SYSID_MYGCS is 1: set it to 7"), "{words}");
    }

    #[test]
    fn a_parameter_of_newer_firmware_may_be_missing_but_not_wrong() {
        let attitude = || Parameters::new(Stack::Ardupilot.rules(Authority::Attitude));
        let asked = |mut parameters: Parameters| {
            (0..100).for_each(|step| drop(parameters.due(AGAIN * step)));
            parameters
        };
        let mut old = attitude();
        old.take("SCHED_LOOP_RATE", 200.0);
        assert_eq!(asked(old).obstacle(1, false), None);
        let mut new = attitude();
        new.take("SCHED_LOOP_RATE", 200.0);
        new.take("GUIDED_TIMEOUT", 3.0);
        let words = asked(new).obstacle(1, false).unwrap();
        assert!(words.contains("GUIDED_TIMEOUT is 3: set it to 0.5"), "{words}");
    }

    #[test]
    fn what_a_radio_asks_for_matters_while_one_is_bound() {
        let parameters = answered(|name| match name {
            "FS_GCS_ENABL" => Some(0.0),
            "MAV_GCS_SYSID_HI" => Some(255.0),
            _ => None,
        });
        assert_eq!(parameters.obstacle(1, false), None);
        let words = parameters.obstacle(1, true).unwrap();
        assert!(words.contains("FS_GCS_ENABL is 0: set it to 1 (a radio is bound"), "{words}");
        assert!(words.contains("MAV_GCS_SYSID_HI is 255: set it to 0"), "{words}");
        assert_eq!(answered(|_| None).obstacle(1, true), None);
    }

    #[test]
    fn violations_beyond_the_length_of_a_text_are_counted() {
        let texts: Vec<String> = (0..9).map(|i| format!("{i}").repeat(100)).collect();
        // 100 + 2 + 100 + 2 + 100 characters; a fourth text would exceed 330
        let words = joined(&texts);
        assert!(words.contains(&texts[2]) && !words.contains(&texts[3]), "{words}");
        assert!(words.ends_with("; and 6 more: see `greylag link check`"), "{words}");
        assert_eq!(joined(&texts[..3]), texts[..3].join("; "));
        let long = "x".repeat(500);
        assert_eq!(joined(std::slice::from_ref(&long)), long);
    }

    #[test]
    fn a_bit_that_must_be_clear_is_said_with_the_rest_kept() {
        let parameters = answered(|name| (name == "RC_OPTIONS").then_some(34.0));
        let words = parameters.obstacle(1, false).unwrap();
        assert!(words.contains("RC_OPTIONS is 34: set it to 32"), "{words}");
    }

    #[test]
    fn a_controller_that_does_not_answer_is_named() {
        let mut parameters = Parameters::new(Stack::Px4.rules(Authority::Attitude));
        assert!(parameters.obstacle(1, false).unwrap().contains("still reading 2"));
        (0..100).for_each(|step| drop(parameters.due(AGAIN * step)));
        assert!(parameters.obstacle(1, false).unwrap().contains("COM_OF_LOSS_T is unknown"));
    }

    #[test]
    fn a_parameter_is_asked_for_again_after_its_time_and_not_for_ever() {
        let mut parameters = Parameters::new(Stack::Px4.rules(Authority::Attitude));
        let both = vec!["COM_OF_LOSS_T", "COM_OBL_RC_ACT"];
        assert_eq!(parameters.due(Duration::ZERO), both);
        assert!(parameters.due(AGAIN - Duration::from_millis(1)).is_empty());
        assert_eq!(parameters.due(AGAIN), both);
        // Each name is requested five times, also those of a parameter with two names.
        let mut parameters = Parameters::new(Stack::Ardupilot.rules(Authority::Surfaces));
        let asked: Vec<_> = (0..200).flat_map(|step| parameters.due(AGAIN * step)).collect();
        for name in ["MAV_GCS_SYSID", "SYSID_MYGCS", "RC_OPTIONS"] {
            assert_eq!(asked.iter().filter(|n| **n == name).count(), 5, "{name}");
        }
    }

    #[test]
    fn the_ends_of_a_range_are_within_it() {
        let mut parameters = Parameters::new(Stack::Px4.rules(Authority::Attitude));
        parameters.take("COM_OBL_RC_ACT", 5.0);
        for (value, good) in [(0.1, true), (0.5, true), (0.0999, false), (0.5001, false)] {
            parameters.take("COM_OF_LOSS_T", value);
            assert_eq!(parameters.obstacle(1, false).is_none(), good, "{value}");
        }
    }

    #[test]
    fn only_the_forbidden_bits_are_to_be_cleared() {
        let parameters = answered(|name| (name == "RC_OPTIONS").then_some(42.0));
        let words = parameters.obstacle(1, false).unwrap();
        assert!(words.contains("RC_OPTIONS is 42: set it to 40"), "{words}");
    }

    #[test]
    fn a_value_that_is_no_number_is_not_stored() {
        let mut parameters = Parameters::new(Stack::Px4.rules(Authority::Attitude));
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            parameters.take("COM_OF_LOSS_T", value);
            assert_eq!(parameters.get("COM_OF_LOSS_T"), None, "{value} while nothing is known");
        }
        parameters.take("COM_OF_LOSS_T", 0.25);
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            parameters.take("COM_OF_LOSS_T", value);
            assert_eq!(parameters.get("COM_OF_LOSS_T"), Some(0.25), "{value}");
        }
    }

    #[test]
    fn a_channel_whose_ends_are_in_the_wrong_order_is_an_obstacle() {
        for (changed, pulse, words) in [
            ("RC1_MIN", 2000.0, "RC1_MIN 2000, RC1_TRIM 1500, RC1_MAX 1900 are not in ascending"),
            ("RC2_TRIM", 2000.0, "RC2_MIN 1100, RC2_TRIM 2000, RC2_MAX 1900 are not in ascending"),
            ("RC3_MAX", 1100.0, "RC3_MIN 1100, RC3_MAX 1100 are not in ascending"),
        ] {
            let parameters = answered(|name| (name == changed).then_some(pulse));
            let said = parameters.obstacle(1, false).unwrap_or_default();
            assert!(said.contains(words), "{said}");
        }
    }
}
