//! The verdict on a flight: one sentence and the measurements that it is based on. A segment is the part of the flight with one
//! target.

use crate::flight::quality::{clause, kept, left, loads, most, outside, outside_in_short};
use crate::flight::{Difficulty, FlightReport, Segment};
use crate::kit::numbers::{attitude, number};
use crate::{LoopTiming, Outcome, Verdict};
use greylag_control::quality::TRANSIENT;
use greylag_logs::Sample;

/// Largest number of missed targets in the list under the sentence.
const LISTED_TARGETS: usize = 6;

/// Time from the first to the last sample, s; 0 without finite times.
pub(crate) fn duration_s(samples: &[Sample]) -> f64 {
    let times = || samples.iter().map(|s| s.time_s).filter(|t| t.is_finite());
    match (times().next(), times().next_back()) {
        (Some(first), Some(last)) => last - first,
        _ => 0.0,
    }
}

/// Parts of the verdict: the clauses of its main sentence, and further measurements.
struct Parts {
    first: Vec<String>,
    beside: Vec<String>,
}

impl Parts {
    fn of(report: &FlightReport) -> Parts {
        let (tracked, all) = (report.tracked(), report.segments.len());
        let flown = report.envelope.map(|e| (kept(&report.flight.samples, &e), e.limits));
        let left_it = flown.as_ref().filter(|(kept, _)| left(kept));
        let beyond = left_it.map(|(kept, limits)| outside(kept, limits));
        let reached = all > 0 && tracked == all;
        let flew = match all {
            0 => format!("flew {:.1} s without a target", duration_s(&report.flight.samples)),
            _ if reached && beyond.is_none() => {
                format!("flew as commanded: {tracked} of {all} targets")
            }
            _ if reached => format!("reached {}", all_targets(all)),
            _ => format!("tracked {tracked} of {all} targets"),
        };
        // what was missed comes first: a target, or a limit that the outcome counts
        let mut first: Vec<String> = match left_it.is_some_and(|(kept, _)| kept.kept) && reached {
            true => [flew].into_iter().chain(beyond).collect(),
            false => beyond.into_iter().chain([flew]).collect(),
        };
        first.iter_mut().take(1).for_each(|clause| *clause = capital(clause));
        first.extend(slowest(report));
        first.extend(largest_error(&report.segments));
        let late = match report.timed().map(LoopTiming::late) {
            None => "loop timing was not recorded".into(),
            Some(0) => "no late cycle of the companion".into(),
            Some(1) => "1 late cycle of the companion".into(),
            Some(n) => format!("{n} late cycles of the companion"),
        };
        let settled = settled_by_difficulty(&report.segments);
        let envelope = flown.as_ref().map(|(kept, limits)| match left(kept) {
            true => loads(kept, limits),
            false => clause(kept, limits),
        });
        let timed = report.timed().filter(|_| report.envelope.is_some());
        let latency = timed.map(|timing| {
            let [p50, p999] = timing.percentiles_us([0.5, 0.999]).map(|us| us / 1e3);
            let budget = number(timing.budget_us / 1e3);
            format!(
                "latency ({}) {} ms in the median, {} ms at p99.9, of {budget} ms",
                timing.measure,
                number(p50),
                number(p999)
            )
        });
        let beside = [envelope, settled, on_the_way(report), Some(late), latency];
        Parts { first, beside: beside.into_iter().flatten().collect() }
    }
}

/// The verdict as one line that contains all parts.
pub(crate) fn sentence(report: &FlightReport) -> String {
    let Parts { first, beside } = Parts::of(report);
    format!("{}.", first.into_iter().chain(beside).collect::<Vec<_>>().join("; "))
}

pub(crate) fn verdict(report: &FlightReport) -> Verdict {
    let (tracked, all) = (report.tracked(), report.segments.len());
    let late = report.timed().map(LoopTiming::late);
    let judged = report.envelope.map(|e| kept(&report.flight.samples, &e)).filter(|k| k.judged);
    let kept = judged.map(|k| k.kept);
    let beyond = judged.filter(left).and_then(|k| outside_in_short(&k));
    let cycles = report.timed().map_or(0, |timing| timing.cycles.len());
    let outcome = outcome(report, kept, late);
    let reason = match (outcome, late) {
        (Outcome::Late, Some(late)) => {
            let slow = format!("this computer was late in {late} of {cycles} cycles");
            beyond.into_iter().chain([slow]).collect::<Vec<_>>().join(", and ")
        }
        (Outcome::Reached, _) => {
            [all_targets(all)].into_iter().chain(beyond).collect::<Vec<_>>().join("; ")
        }
        _ => reason(all - tracked, late, kept),
    };
    let Parts { first, beside } = Parts::of(report);
    let beside = beside.iter().map(|part| capital(part) + ".");
    let details = not_tracked(report).into_iter().chain(beside).chain(details(report)).collect();
    let sentence = format!("{}.", first.join("; "));
    let (before_next, next) = (String::new(), report.next.clone());
    Verdict { outcome, reason, sentence, details, before_next, next }
}

/// The outcome of a flight. `kept` states whether load factor and angle of attack kept their limits, and `late` the number of late
/// cycles; `None` if they are unknown.
fn outcome(report: &FlightReport, kept: Option<bool>, late: Option<usize>) -> Outcome {
    let (tracked, all) = (report.tracked(), report.segments.len());
    match (all, late) {
        _ if tracked < all || kept == Some(false) => Outcome::Missed,
        (0, _) | (_, None) => Outcome::Open,
        _ if report.envelope.is_some() && kept.is_none() => Outcome::Open,
        (_, Some(1..)) => Outcome::Late,
        _ => Outcome::Reached,
    }
}

/// Phrase for all targets of a flight with `count` of them.
fn all_targets(count: usize) -> String {
    match count {
        1 => "the target".into(),
        2 => "both targets".into(),
        _ => format!("all {count} targets"),
    }
}

/// The missed requirements as text; empty if none was missed.
fn reason(not_tracked: usize, late: Option<usize>, kept: Option<bool>) -> String {
    let plural = |n: usize, one: &str| match n {
        1 => format!("1 {one}"),
        n => format!("{n} {one}s"),
    };
    let mut all = Vec::new();
    if not_tracked > 0 {
        all.push(plural(not_tracked, "target") + " not tracked");
    }
    if kept == Some(false) {
        all.push("load factor or angle of attack beyond its limit".into());
    }
    if let Some(late @ 1..) = late {
        all.push(plural(late, "cycle") + " of the loop late");
    }
    all.join(", ")
}

/// The text with a capital first letter.
fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Text on the largest error integral with its target, and on the largest overshoot of all segments; `None` without segments or
/// limits.
fn on_the_way(report: &FlightReport) -> Option<String> {
    let qualities = report.qualities().filter(|all| !all.is_empty())?;
    let integral = most(&qualities, |q| q.error_integral_deg_s);
    let slowest =
        report.segments.iter().zip(&qualities).find(|(_, q)| q.error_integral_deg_s == integral);
    let at = slowest.map_or_else(String::new, |(s, _)| {
        let [roll, pitch] = [s.roll_target_rad, s.pitch_target_rad].map(signed);
        format!(" (to roll {roll}°, pitch {pitch}°)")
    });
    let overshoot = most(&qualities, |q| q.overshoot_deg[0].max(q.overshoot_deg[1]));
    let (integral, overshoot) = (number(integral), number(overshoot));
    Some(format!("integral of error up to {integral}° s{at}, overshoot up to {overshoot}°"))
}

/// Text on the target that took longest to reach; `None` without segments or limits, or with a single segment.
fn slowest(report: &FlightReport) -> Option<String> {
    let qualities = report.qualities().filter(|all| all.len() > 1)?;
    let timed = report.segments.iter().zip(&qualities).filter(|(_, q)| q.to_one_deg_s.is_finite());
    let (segment, _) = timed.max_by(|a, b| a.1.to_one_deg_s.total_cmp(&b.1.to_one_deg_s))?;
    Some(format!("slowest to {}", target(segment)))
}

/// Text on the largest settled error, with its target; `None` without a finite error.
fn largest_error(segments: &[Segment]) -> Option<String> {
    let known = segments.iter().filter(|s| s.settled_error_rad.is_finite());
    let worst = known.max_by(|a, b| a.settled_error_rad.total_cmp(&b.settled_error_rad))?;
    Some(format!(
        "largest settled error {}, at {}",
        degrees(worst.settled_error_rad),
        target(worst)
    ))
}

/// The target of a segment in words.
fn target(segment: &Segment) -> String {
    attitude([segment.roll_target_rad, segment.pitch_target_rad].map(f64::to_degrees))
}

/// Text on the mean settled error of each group of targets; `None` without a finite error.
fn settled_by_difficulty(segments: &[Segment]) -> Option<String> {
    let group = |difficulty: Difficulty| {
        let of = segments.iter().filter(|s| s.difficulty == difficulty);
        let errors: Vec<f64> = of.map(|s| s.settled_error_rad).filter(|e| e.is_finite()).collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        (!errors.is_empty()).then(|| format!("{} {}", degrees(mean), difficulty.name()))
    };
    let groups: Vec<String> =
        [Difficulty::Easy, Difficulty::Hard].into_iter().filter_map(group).collect();
    (!groups.is_empty()).then(|| format!("mean settled error {}", groups.join(", ")))
}

fn details(report: &FlightReport) -> Vec<String> {
    let mut details = Vec::new();
    if !report.segments.is_empty() {
        let tolerance = degrees(report.tolerance_rad);
        details.push(format!(
            "A target counts as tracked when its settled error is at most {tolerance}."
        ));
    }
    if report.envelope.is_some() {
        details.push(format!(
            "The outcome counts the limits of load factor and angle of attack, which may be passed by {} %; times outside the \
             limits of bank, pitch, sideslip and airspeed are stated beside it.",
            100.0 * TRANSIENT
        ));
    }
    // with an envelope, the latency is already part of the verdict
    if let Some(timing) = report.timed().filter(|_| report.envelope.is_none()) {
        let [p50, p99, p999] = timing.percentiles_us([0.5, 0.99, 0.999]).map(|us| us / 1e3);
        details.push(format!(
            "Loop, {}: p50 {p50:.2} ms, p99 {p99:.2} ms, p99.9 {p999:.2} ms of {} ms.",
            timing.measure,
            timing.budget_us / 1e3
        ));
    }
    details
}

/// One line for each of the first `LISTED_TARGETS` missed targets, and one line with the number of the others.
fn not_tracked(report: &FlightReport) -> Vec<String> {
    let missed = || {
        let numbered = report.segments.iter().zip(1..);
        numbered.filter(|(s, _): &(&Segment, usize)| !s.tracked(report.tolerance_rad))
    };
    let line = |(s, number): (&Segment, usize)| {
        let (roll, pitch) = (signed(s.roll_target_rad), signed(s.pitch_target_rad));
        let error = degrees(s.settled_error_rad);
        format!(
            "Not tracked: target {number}, roll {roll}°, pitch {pitch}°, settled error {error}."
        )
    };
    let mut lines: Vec<String> = missed().take(LISTED_TARGETS).map(line).collect();
    let beyond = missed().count().saturating_sub(LISTED_TARGETS);
    if beyond > 0 {
        lines.push(format!("Not tracked either: {beyond} more, in the table of targets."));
    }
    lines
}

/// An angle in degrees with its sign and one decimal.
pub(crate) fn signed(rad: f64) -> String {
    format!("{:+.1}", rad.to_degrees()).replace('-', "−")
}

/// An error in degrees. The number of decimals is such that a small error is not shown as zero.
pub(crate) fn degrees(rad: f64) -> String {
    let deg = rad.to_degrees();
    match deg.abs() {
        _ if !deg.is_finite() => "unknown".into(),
        a if a < 0.0095 && a > 0.0 => format!("{deg:.4}°"),
        a if a < 9.95 => format!("{deg:.2}°"),
        _ => format!("{deg:.1}°"),
    }
}
