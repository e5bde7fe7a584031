//! Sentences of an evaluation's answer: the controller with the smallest settled error and whether it keeps its limits, its worst
//! target, the other controllers, lost targets.

use super::{excess, label};
use crate::kit::numbers::{attitude, number};
use greylag_sim::Group;
use greylag_sim::evaluation::{Evaluation, Score};

/// The limits that count as the envelope here, of a controller that keeps them and of one that does not.
const KEEPS: &str = "keeps its limits of load factor and angle of attack";
const LEAVES: &str = "outside the limits of load factor or angle of attack";
/// Group of targets over which controllers are ranked if the evaluation contains it.
const ALL: &str = "all";
/// A controller ranks behind the others if its fraction of flights that keep the envelope is more than this below the largest
/// one: one flight in twenty. A small settled error does not compensate for a load factor beyond the limit.
const KEPT_APART: f64 = 0.05;

/// An evaluation with its score over the ranked group.
type Ranked<'a> = (&'a Evaluation, &'a Score);

/// The evaluation that ranks first; `None` if there are no scores.
pub fn best(evaluations: &[Evaluation]) -> Option<&Evaluation> {
    let [keeping, _] = ranked(evaluations, &ranked_over(evaluations)?);
    keeping.first().map(|(e, _)| *e)
}

/// Evaluations with their scores over `group`, sorted by settled error: first those that keep the envelope, then the others.
fn ranked<'a>(evaluations: &'a [Evaluation], group: &str) -> [Vec<Ranked<'a>>; 2] {
    let mut all: Vec<Ranked> =
        evaluations.iter().filter_map(|e| Some((e, e.score(group)?))).collect();
    all.sort_by(|(_, a), (_, b)| a.mean_deg.total_cmp(&b.mean_deg));
    let most = all.iter().map(|(_, s)| s.kept_rate).fold(f64::NAN, f64::max);
    // without quality measures this fraction is NaN and does not affect the ranking
    let (leaving, keeping) = all.into_iter().partition(|(_, s)| s.kept_rate < most - KEPT_APART);
    [keeping, leaving]
}

/// The sentences of the answer: the controller with the smallest settled error and the limits that it keeps, flights outside the
/// limits, its worst target, the other controllers, lost targets. Empty if there are no scores. `limited` states that the envelope limiter was used.
pub fn sentences(evaluations: &[Evaluation], limited: bool) -> Vec<String> {
    let Some(group) = ranked_over(evaluations) else { return Vec::new() };
    let [keeping, leaving] = ranked(evaluations, &group);
    let Some((best, rest)) = keeping.split_first() else { return Vec::new() };
    let ranked = [&keeping[..], &leaving[..]].concat();
    let mut all = vec![match ranked.len() {
        1 => alone(evaluations, *best),
        _ => leader(evaluations, *best, &ranked),
    }];
    all.push(excess::sentence(ranked.iter().map(|(e, _)| *e), evaluations, limited));
    all.extend(worst_target(best.0));
    all.extend(followers(evaluations, *best, rest, &leaving));
    all.push(match ranked.iter().all(|(_, s)| s.divergence_rate == 0.0) {
        true => "No target was lost.".into(),
        false => {
            let lost = |(e, s): &Ranked| format!("{} {}", label(e, evaluations), percent(s));
            let lost: Vec<String> = ranked.iter().map(lost).collect();
            format!("Targets lost (over 10° off): {}.", lost.join(", "))
        }
    });
    all
}

/// The group "all" (Table II of the paper) if the evaluation contains it, otherwise the group with most targets.
fn ranked_over(evaluations: &[Evaluation]) -> Option<String> {
    let groups = &evaluations.first()?.groups;
    let most = groups.iter().max_by_key(|score| score.count)?;
    let all = groups.iter().find(|score| score.targets == ALL);
    Some(all.unwrap_or(most).targets.clone())
}

/// Sentence on a single controller: its limits and its settled error.
fn alone(all: &[Evaluation], (only, score): Ranked) -> String {
    let name = label(only, all);
    let limits = match outside(score) {
        None => String::new(),
        Some(0) if score.count == 1 => format!("{KEEPS}{} and ", without(only, score)),
        Some(left) => format!("{KEEPS} in {} and ", kept_in(only, score, left)),
    };
    let over = match limits.is_empty() {
        true => format!(" over {}", flights(only, score)),
        false => String::new(),
    };
    let [low, high] = score.mean_ci95_deg.map(number);
    format!(
        "{name} {limits}settles on average{over} within {}° of the command (95 %: {low} to {high}°).",
        number(score.mean_deg)
    )
}

/// Sentences on the controller that ranks first among several: its settled error and, separately, its limits. If it leaves them in
/// any flight, they name the controller of `ranked` with the smallest settled error that keeps them in all flights.
fn leader(all: &[Evaluation], (best, score): Ranked, ranked: &[Ranked]) -> String {
    let smaller = ranked.iter().any(|(_, s)| s.mean_deg < score.mean_deg);
    let of = if smaller { " of those that keep their limits most often" } else { "" };
    let [low, high] = score.mean_ci95_deg.map(number);
    let mut said = format!(
        "Smallest settled error{of}: {}, on average {}° (95 %: {low} to {high}°)",
        label(best, all),
        number(score.mean_deg)
    );
    let Some(left) = outside(score) else {
        return format!("{said}, over {}.", flights(best, score));
    };
    if left == 0 {
        return format!("{said}. It {KEEPS} in {}.", kept_in(best, score, 0));
    }
    said += &format!(". It is {LEAVES} in {left} of {}", flights(best, score));
    let keeping = ranked.iter().filter(|(_, s)| outside(s) == Some(0));
    match keeping.min_by(|(_, a), (_, b)| a.mean_deg.total_cmp(&b.mean_deg)) {
        Some((e, s)) => {
            let (name, error) = (label(e, all), number(s.mean_deg));
            format!("{said}; {name} {KEEPS} in all, with {error}°.")
        }
        None => format!("{said}; no controller keeps them in all."),
    }
}

/// Phrase for the number of flights of the group of `score`.
fn flights(e: &Evaluation, score: &Score) -> String {
    let all = match score.count {
        1 => "1 flight".to_owned(),
        n => format!("{n} flights"),
    };
    all + &without(e, score)
}

/// Phrase for the flights in which the limits are kept, if they are left in `left` of them.
fn kept_in(e: &Evaluation, score: &Score, left: usize) -> String {
    match left {
        0 => format!("all {}", flights(e, score)),
        left => format!("{} of {}", score.count - left, flights(e, score)),
    }
}

/// Names in parentheses of the groups that the ranking leaves out; empty if there are none.
fn without(e: &Evaluation, score: &Score) -> String {
    match left_out(e, score).as_slice() {
        [] => String::new(),
        groups => format!(" (ranked without {})", groups.join(" and ")),
    }
}

/// Names of the groups that were flown and are not part of the group of `score`.
fn left_out<'a>(e: &'a Evaluation, score: &Score) -> Vec<&'a str> {
    let parts = [Group::Easy, Group::HardCorners].map(Group::name);
    let is_part = |name: &str| match score.targets.as_str() {
        ALL => name == ALL || parts.contains(&name),
        group => name == group,
    };
    e.groups.iter().map(|s| s.targets.as_str()).filter(|name| !is_part(name)).collect()
}

/// Number of flights of a group that left the envelope; `None` if this was not measured.
fn outside(score: &Score) -> Option<usize> {
    let share = 1.0 - score.kept_rate;
    share.is_finite().then(|| (share * score.count as f64).round() as usize)
}

/// Sentence on the target with the largest settled error; `None` if there is no group. The attitude is not stated if the
/// single flights are unknown.
fn worst_target(best: &Evaluation) -> Option<String> {
    let known = best.flights.iter().filter(|f| f.settled_deg.is_finite());
    if let Some(f) = known.max_by(|a, b| a.settled_deg.total_cmp(&b.settled_deg)) {
        return Some(format!(
            "Its worst target: {}, settled error {}°.",
            attitude(f.to_deg),
            number(f.settled_deg)
        ));
    }
    let groups = best.groups.iter().filter(|s| s.targets != ALL);
    let worst = groups.max_by(|a, b| a.max_deg.total_cmp(&b.max_deg))?;
    Some(format!("Its worst target has a settled error of {}°.", number(worst.max_deg)))
}

/// Sentences on the controllers behind the best one: `rest` keep the envelope as often as the best one, `leaving` do not.
fn followers(
    all: &[Evaluation],
    (_, score): Ranked,
    rest: &[Ranked],
    leaving: &[Ranked],
) -> Vec<String> {
    // the intervals of controllers with about the same error overlap
    let alike = |(_, other): &&Ranked| other.mean_ci95_deg[0] <= score.mean_ci95_deg[1];
    let same: Vec<&Ranked> = rest.iter().filter(alike).collect();
    let behind: Vec<&Ranked> = rest.iter().filter(|r| !alike(r)).chain(leaving).collect();
    let error = |(e, s): &Ranked| format!("{} {}°", label(e, all), number(s.mean_deg));
    let mut said = Vec::new();
    if !same.is_empty() {
        let same: Vec<String> = same.into_iter().map(error).collect();
        said.push(format!("Not distinguished from it by these targets: {}.", same.join(", ")));
    }
    if !behind.is_empty() {
        let mut first = true;
        let one = |ranked: &Ranked| {
            let Some(left @ 1..) = outside(ranked.1) else { return error(ranked) };
            let but = if ranked.1.mean_deg < score.mean_deg { "but " } else { "" };
            let of = if std::mem::take(&mut first) { LEAVES } else { "outside" };
            format!("{}, {but}{of} in {left} of {}", error(ranked), ranked.1.count)
        };
        let behind: Vec<String> = behind.into_iter().map(one).collect();
        said.push(format!("Behind it: {}.", behind.join("; ")));
    }
    said
}

/// The share of lost targets in percent.
fn percent(score: &Score) -> String {
    format!("{} %", number(100.0 * score.divergence_rate))
}
