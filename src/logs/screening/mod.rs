//! Screening: wrong units, signs and axes, found before anything is computed from a log.
//!
//! Each check uses a relation that holds for every aeroplane whatever its coefficients:
//! - The Euler angles are the integral of their rates, which follow from the body rates.
//! - A steady turn has V ψ̇ = g tan φ.
//! - The altitude is the integral of the climb rate.
//! - The course turns with the heading.
//! - A positive aileron rolls the aircraft to the right.
//! - Thrust pushes the aircraft forward and feeds its energy.
//!
//! A finding names the column and the mapping that corrects it. No column is converted without a mapping.

mod air;
mod angles;
mod clock;
mod course;
mod cure;
mod dead;
mod force;
mod held;
mod relation;
mod surfaces;
mod throttle;

use std::borrow::Cow;

use super::Sample;
use super::finding::{Cure, Finding, Severity};
use super::lag;
use super::phases::{self, Flying, PhaseKind};

/// Smallest number of rows for checks of units.
const ENOUGH: usize = 50;

/// Returns all findings about `rows`. Then sets those sensor columns to NaN that are constant although the aircraft flies. `flies`
/// states when the aircraft counts as flying.
pub fn screened(rows: &mut [Sample], flies: &Flying) -> Vec<Finding> {
    let (found, flown) = screen(rows, flies);
    if flown {
        dead::blank(rows);
    }
    found
}

/// The note that a flight does not show the signs of surfaces that move; `None` if it shows them.
pub fn hidden_signs(rows: &[Sample], flies: &Flying) -> Option<Finding> {
    surfaces::hidden_signs(&in_flight(rows, flies), flies)
}

/// All findings about `rows`, and whether the aircraft flies in them.
fn screen(rows: &[Sample], flies: &Flying) -> (Vec<Finding>, bool) {
    if rows.is_empty() {
        return (vec![Finding::problem("the log has no rows with all needed channels")], false);
    }
    let mut out = Vec::new();
    let mut flies_at_all = false;
    if rows.len() >= ENOUGH {
        let flown = in_flight(rows, flies);
        flies_at_all = !flown.is_empty();
        let of = |rows: &[Sample]| checks(rows, &in_flight(rows, flies), flies);
        out = cure::tried(checks(rows, &flown, flies), rows, of);
        let dead = dead::check(rows);
        // On the ground a channel may be constant, in a simulation exactly so. Without a flight only a constant
        // airspeed is reported.
        out.extend(dead.into_iter().filter(|f| flies_at_all || f.text.starts_with("airspeed")));
        out.extend(dead::commands(&flown));
        let right = out.iter().all(|f| f.severity != Severity::Problem);
        if right {
            out.extend(lag::check(&flown));
        }
    }
    out.extend(flight(rows, flies));
    (out, flies_at_all)
}

/// Checks of units, signs and axes. They use the rows in wing-borne flight (`flown`) if there are enough, because
/// other relations hold in hover and on the ground.
fn checks(rows: &[Sample], flown: &[Sample], flies: &Flying) -> Vec<Finding> {
    if let Some(clock) = clock::check(rows) {
        return vec![clock];
    }
    let flies_at_all = flown.len() >= ENOUGH;
    let rows = if flies_at_all { flown } else { rows };
    let mut out = angles::check(rows, flies_at_all);
    out.extend(force::check(rows));
    let flown_s = flown.first().zip(flown.last()).map_or(0.0, |(a, b)| b.time_s - a.time_s);
    let course = if out.is_empty() { course::check(rows) } else { None };
    let axes_are_right = out.is_empty() && !(flies_at_all && flown_s < flies.shortest_s);
    out.extend(course);
    out.extend(air::check(rows, flown));
    out.extend(surfaces::check(rows, axes_are_right, flies));
    out
}

/// The rows in flight. They are copied only if other rows lie between them.
fn in_flight<'a>(rows: &'a [Sample], flies: &Flying) -> Cow<'a, [Sample]> {
    let phases = phases::phases(rows, flies);
    let flights: Vec<_> = phases.iter().filter(|p| p.kind == PhaseKind::Flight).collect();
    let flies = |s: &Sample| flights.iter().any(|p| (p.from_s..=p.to_s).contains(&s.time_s));
    let (Some(first), Some(last)) = (rows.iter().position(flies), rows.iter().rposition(flies))
    else {
        return Cow::Borrowed(&[]);
    };
    match rows[first..=last].iter().all(flies) {
        true => Cow::Borrowed(&rows[first..=last]),
        false => Cow::Owned(rows.iter().filter(|s| flies(s)).copied().collect()),
    }
}

/// Returns a problem if the log has no flight, or if its flight time is too short.
fn flight(rows: &[Sample], flies: &Flying) -> Option<Finding> {
    let flights: Vec<_> =
        phases::phases(rows, flies).into_iter().filter(|p| p.kind == PhaseKind::Flight).collect();
    if flights.is_empty() {
        let fastest = relation::values(rows, |s| s.airspeed_mps).into_iter().reduce(f64::max)?;
        return Some(Finding::problem(format!(
            "there is no flight in this log: airspeed never stays above {:.3} m/s for {:.1} s (largest value {fastest:.1} m/s); give a log with a flight, check the airspeed channel, or name the aircraft's model, whose envelope says from when on it flies, or state [flight] from_mps and shortest_s in a mapping",
            flies.from_mps, flies.sustained_s
        )));
    }
    let flown: f64 = flights.iter().map(|p| p.to_s - p.from_s).sum();
    (rows.len() >= ENOUGH && flown < flies.shortest_s).then(|| {
        Finding::problem(format!(
            "the log holds {flown:.1} s of flight: a verdict needs at least {:.1} s, an effect about a minute; give a longer log",
            flies.shortest_s
        ))
    })
}

/// The problem `what`, with the mapping that multiplies `column` by `scale` as its remedy.
fn cured(what: String, column: &str, scale: f64) -> Finding {
    cured_by(what, Cure::factor(column, scale))
}

/// The problem `what`, of which the log does not show the cause. Each of `choices` is a cause in words and its correction.
fn undecided(what: &str, choices: Vec<(&str, Cure)>) -> Finding {
    let lines: Vec<String> =
        choices.iter().map(|(cause, cure)| format!("{} for {cause}", cure.line())).collect();
    let text = format!(
        "{what}. The log does not show which: write one line into [columns] of a mapping and read it with --mapping FILE: {}",
        lines.join(", or ")
    );
    let choices = choices.into_iter().map(|(_, cure)| cure).collect();
    Finding { choices, ..Finding::problem(text) }
}

/// The problem `what`, with the mapping that makes the correction `cure` as its remedy.
fn cured_by(what: String, cure: Cure) -> Finding {
    Finding { cure: Some(cure.clone()), ..Finding::problem(format!("{what}: {cure}")) }
}
