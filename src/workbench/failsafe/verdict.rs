//! The events of a simulated failsafe flight in time order, and the verdict in words. In such a flight the user causes faults
//! while the companion (this program's autopilot) controls the aircraft, in most cases through a flight controller.

use super::Flown;
use super::bands::{companion, spans};
use super::choices::{fault, request};
use super::form::FLIGHT_S;
use greylag_flight::pilot::{TICK_S, mode_name};
use greylag_link::autopilot::Verdict;
use greylag_report::{Span, Tone};
use greylag_sim::faults::policies::Sample;
use greylag_sim::faults::{Asking, Fault, Finding, Found};

/// Largest number of changes that a sentence names.
const NAMED: usize = 4;
/// Longest time between arming and the request for OFFBOARD at which both count as one request, s.
const TOGETHER_S: f64 = 0.2;
/// Time (s) after a fault or request at which its consequence is evaluated.
const LATER_S: f64 = 2.0;

/// Loss of altitude (m) from which on the verdict mentions it.
const MUCH_M: f64 = 30.0;

/// A fault or request that can cause later changes.
struct Cause {
    at_s: f64,
    words: String,
    /// Time, s, and kind of the request; `None` for a fault.
    asked: Option<(f64, Asking)>,
}

/// One event of the flight.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Happened {
    pub at_s: f64,
    pub who: Who,
    pub what: String,
}

/// Origin of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    /// A fault of the scenario.
    Fault,
    /// The client or a ground station.
    Client,
    /// The companion, this program's autopilot.
    Companion,
    /// The flight controller between companion and aircraft.
    Controller,
}

impl Who {
    /// Displayed name of the origin.
    pub fn name(self, stack: Option<&'static str>) -> &'static str {
        match self {
            Who::Fault => "fault",
            Who::Client => "request",
            Who::Companion => "companion",
            Who::Controller => stack.unwrap_or("controller"),
        }
    }
}

impl Flown {
    /// All events of the flight and all texts that the companion sent, in time order.
    pub(super) fn events(&self) -> Vec<Happened> {
        let mut all = self.befallen();
        let said = |(at_s, words): &(f64, String)| Happened {
            at_s: *at_s,
            who: Who::Companion,
            what: words.clone(),
        };
        all.extend(self.witnessed.texts.iter().map(said));
        all.extend(self.modes().into_iter().skip(1).map(|span| Happened {
            at_s: span.time_s[0],
            who: Who::Controller,
            what: format!("mode {}", span.word),
        }));
        all.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        all
    }

    /// The faults, and the requests with the companion's answers.
    fn befallen(&self) -> Vec<Happened> {
        let happened = |at_s, who, what| Happened { at_s, who, what };
        let mut all = Vec::new();
        for f in &self.scenario.faults {
            let name = fault(f.kind).0;
            all.push(happened(f.from_s, Who::Fault, name.to_owned()));
            let ends = f.kind.has_length() && f.to_s < FLIGHT_S;
            all.extend(ends.then(|| happened(f.to_s, Who::Fault, format!("{name}: over"))));
        }
        for asked in &self.scenario.asked {
            let words = match (asked.what, self.answer(asked.at_s, asked.what)) {
                (Asking::TakeOver, _) => String::new(),
                (_, None) => ": nobody answers".into(),
                (_, Some(Verdict::Accepted)) => ": accepted".into(),
                (_, Some(Verdict::Rejected(why) | Verdict::Denied(why))) => format!(": {why}"),
            };
            all.push(happened(asked.at_s, Who::Client, request(asked.what).to_owned() + &words));
        }
        all
    }

    /// The successive modes of the flight controller, with their times.
    fn modes(&self) -> Vec<Span> {
        let counterpart = self.scenario.counterpart;
        spans(&self.witnessed.samples, |s| {
            let mode = s.controller?;
            Some((counterpart.mode_name(mode).to_owned(), Tone::Idle))
        })
    }

    /// All changes that [`change`](Self::change) finds in the flight, as time (s) and text, in time order.
    fn deeds(&self) -> Vec<(f64, String)> {
        let mut all: Vec<(f64, String)> = Vec::new();
        for (k, pair) in self.witnessed.samples.windows(2).enumerate() {
            let at_s = (k + 1) as f64 * TICK_S;
            let clauses = self.change(&pair[0], &pair[1]).into_iter().flatten();
            all.extend(clauses.map(|clause| (at_s, format!("{clause} at {at_s:.2} s"))));
        }
        all
    }

    /// Texts on what changed between two consecutive samples: the companion's mode or control authority, and the mode of the
    /// flight controller.
    fn change(&self, before: &Sample, now: &Sample) -> [Option<String>; 2] {
        let counterpart = self.scenario.counterpart;
        let companion = match (before.shown, now.shown) {
            (_, None) => None,
            (None, Some(_)) => Some("the companion started again".to_owned()),
            (Some(was), Some(is)) if was.armed && is.armed && was != is => {
                let failsafe = if is.failsafe { ", a failsafe" } else { "" };
                Some(format!("the companion went to {}{failsafe}", mode_name(is.mode)))
            }
            _ if counterpart.stack().is_none() || before.engaged == now.engaged => None,
            _ if now.engaged => Some("the companion asked for the aircraft".into()),
            _ if before.steered => Some("the companion handed back".into()),
            _ => Some("the companion let go".into()),
        };
        let mode = now.controller.filter(|mode| before.controller.is_some_and(|was| was != *mode));
        let stack = counterpart.stack().zip(mode);
        let controller = stack
            .map(|(stack, mode)| format!("{stack} changed to {}", counterpart.mode_name(mode)));
        [companion, controller]
    }

    /// The verdict: one sentence for each fault or request with its consequences, then sentences on the end of the flight and on
    /// the rules of flight.
    pub(super) fn sentence(&self) -> String {
        let causes = self.causes();
        let deeds = self.deeds();
        let mut text = String::new();
        for (k, cause) in causes.iter().enumerate() {
            let until = causes.get(k + 1).map_or(f64::INFINITY, |next| next.at_s);
            let own = deeds.iter().filter(|(at_s, _)| (cause.at_s..until).contains(at_s));
            let own = own.map(|(_, clause)| clause.clone());
            let own: Vec<String> = self.left_alone(cause).into_iter().chain(own).collect();
            let outcome = match own.len() {
                0 => self.nothing_changed(cause),
                n if n > NAMED => {
                    format!("{}; {} more changes", own[..NAMED].join("; "), n - NAMED)
                }
                _ => own.join("; "),
            };
            text += &format!("{}: {outcome}. ", cause.words);
        }
        if causes.is_empty() {
            text += "Nothing went wrong. ";
        }
        format!("{text}{}{} {}", self.end(), self.lost(), self.rules_in_words())
    }

    /// The faults and requests, in time order.
    fn causes(&self) -> Vec<Cause> {
        let of_fault = |f: &Fault| {
            let (name, from, to) = (fault(f.kind).0, f.from_s, f.to_s);
            let words = match f.kind.has_length() && to < FLIGHT_S {
                true => format!("{name} from {from:.1} to {to:.1} s"),
                false => format!("{name} at {from:.1} s"),
            };
            Cause { at_s: from, words, asked: None }
        };
        let mut all: Vec<Cause> = self.scenario.faults.iter().map(of_fault).collect();
        let asked = &self.scenario.asked;
        let mut k = 0;
        while let Some(now) = asked.get(k) {
            let next = asked.get(k + 1).filter(|next| {
                let both = (now.what, next.what) == (Asking::Arm, Asking::Offboard);
                both && next.at_s - now.at_s <= TOGETHER_S
            });
            let words = match next {
                Some(_) => format!("The client arms and asks for OFFBOARD at {:.1} s", now.at_s),
                None => format!("The {} at {:.1} s", request(now.what), now.at_s),
            };
            let last = next.unwrap_or(now);
            all.push(Cause { at_s: now.at_s, words, asked: Some((last.at_s, last.what)) });
            k += if next.is_some() { 2 } else { 1 };
        }
        all.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        all
    }

    /// Text on a fault or request after which no change occurred.
    fn nothing_changed(&self, cause: &Cause) -> String {
        match cause.asked.map(|(at_s, what)| self.answer(at_s, what)) {
            Some(Some(Verdict::Rejected(why) | Verdict::Denied(why))) => return why.clone(),
            Some(None) if !matches!(cause.asked, Some((_, Asking::TakeOver))) => {
                return "nobody answers".into();
            }
            _ => {}
        }
        match self.later(cause) {
            Some(s) if s.engaged => "the companion flew on".into(),
            _ => "nothing changed".into(),
        }
    }

    /// The sample at which the consequence of `cause` is evaluated.
    fn later(&self, cause: &Cause) -> Option<&Sample> {
        let samples = &self.witnessed.samples;
        samples.get(((cause.at_s + LATER_S) / TICK_S) as usize).or(samples.last())
    }

    /// Text on an aircraft that nobody controls after `cause`; `None` if somebody controls it.
    fn left_alone(&self, cause: &Cause) -> Option<String> {
        let later = self.later(cause).filter(|s| s.shown.is_none() && s.steered)?;
        let counterpart = self.scenario.counterpart;
        Some(match counterpart.stack().zip(later.controller) {
            Some((stack, mode)) => {
                format!("nobody flies it, {stack} stays in {}", counterpart.mode_name(mode))
            }
            None => "nobody flies it, the surfaces stay where they are".into(),
        })
    }

    /// The companion's answer to the request `asked` at the time `asked_s` (s); `None` without an answer.
    fn answer(&self, asked_s: f64, asked: Asking) -> Option<&Verdict> {
        let mut answers = self.witnessed.answers.iter();
        let near = |at_s: f64| (at_s - asked_s).abs() < 2.0 * TICK_S;
        answers.find(|(at_s, what, _)| *what == asked && near(*at_s)).map(|(.., verdict)| verdict)
    }

    /// A sentence on how the flight ended.
    fn end(&self) -> String {
        let Some(last) = self.witnessed.samples.last() else { return String::new() };
        let found = |finding| self.witnessed.findings.iter().find(|f| f.finding == finding);
        if let Some(crash) = found(Finding::Crash) {
            return format!("The aircraft was lost at {:.1} s.", crash.at_s);
        }
        if found(Finding::Panic).is_some() {
            return "The companion's program panicked: please report it.".into();
        }
        let mode = last.controller.map(|m| self.scenario.counterpart.mode_name(m));
        let shown = companion(last).map_or_else(String::new, |(word, _)| word);
        match (self.scenario.counterpart.stack(), mode) {
            (Some(stack), Some(mode)) if last.engaged && last.steered => {
                format!("At the end the companion steers, in {shown}, {stack} in {mode}.")
            }
            (Some(stack), Some(mode)) if last.steered => {
                format!("At the end nobody flies: {stack} is in {mode}, the companion {shown}.")
            }
            (Some(stack), Some(mode)) => {
                format!("At the end {stack} flies {mode}, the companion is {shown}.")
            }
            _ => format!("At the end the companion is in {shown}."),
        }
    }

    /// A sentence on the loss of altitude; empty if the loss is below `MUCH_M`.
    fn lost(&self) -> String {
        let lost = self.witnessed.samples.iter().map(|s| s.lost_m).fold(0.0, f64::max);
        if lost < MUCH_M { String::new() } else { format!(" The aircraft lost {lost:.0} m.") }
    }

    /// A sentence on the rules of flight, requirements on the companion. It states that all hold, or which are broken.
    fn rules_in_words(&self) -> String {
        let judged = self.judged.iter().zip(&self.rules);
        let judged: Vec<_> =
            judged.filter_map(|(d, rule)| Some((d.as_ref()?.0, rule.id))).collect();
        let broken: Vec<&str> =
            judged.iter().filter(|(distance, _)| *distance < 0.0).map(|(_, id)| *id).collect();
        match broken.len() {
            0 => format!("All {} rules of flight that apply hold.", judged.len()),
            _ => format!("Broken, of {} rules of flight: {}.", judged.len(), broken.join(", ")),
        }
    }

    /// CSS class of the verdict. It is "unexplained" if a rule is broken, the aircraft is lost or the program panicked, "open" if
    /// nobody controlled the aircraft after a fault or request, and otherwise "effect".
    pub(super) fn standing(&self) -> &'static str {
        let bad = |f: &Found| matches!(f.finding, Finding::Crash | Finding::Panic);
        let broken = self.judged.iter().flatten().any(|(distance, _)| *distance < 0.0);
        match broken || self.witnessed.findings.iter().any(bad) {
            true => "unexplained",
            false if self.causes().iter().any(|cause| self.left_alone(cause).is_some()) => "open",
            false => "effect",
        }
    }
}
