//! Sentences of an evaluation's answer: the best controller, its worst target, the other controllers, lost targets.

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

/// The sentences of the answer: the best controller, flights outside the limits, the worst target of the best, the other
/// controllers, lost targets. Empty if there are no scores. `limited` states that the envelope limiter was used.
pub fn sentences(evaluations: &[Evaluation], limited: bool) -> Vec<String> {
    let Some(group) = ranked_over(evaluations) else { return Vec::new() };
    let [keeping, leaving] = ranked(evaluations, &group);
    let Some((best, rest)) = keeping.split_first() else { return Vec::new() };
    let ranked = [&keeping[..], &leaving[..]].concat();
    let mut all = vec![leader(evaluations, *best, ranked.len() == 1)];
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

/// Sentence on the best controller: envelope and settled error. `alone` states that there is no other controller.
fn leader(all: &[Evaluation], (best, score): Ranked, alone: bool) -> String {
    let name = label(best, all);
    let begin = if alone { name } else { format!("Best: {name}. It") };
    let without = match left_out(best, score).as_slice() {
        [] => String::new(),
        groups => format!(" (ranked without {})", groups.join(" and ")),
    };
    let flights = match score.count {
        1 => format!("1 flight{without}"),
        n => format!("{n} flights{without}"),
    };
    let envelope = match outside(score) {
        None => String::new(),
        Some(0) if score.count == 1 => format!("{KEEPS}{without} and "),
        Some(0) => format!("{KEEPS} in all {flights} and "),
        Some(left) => format!("{KEEPS} in {} of {flights} and ", score.count - left),
    };
    let over = if envelope.is_empty() { format!(" over {flights}") } else { String::new() };
    let [low, high] = score.mean_ci95_deg.map(number);
    format!(
        "{begin} {envelope}settles on average{over} within {}° of the command (95 %: {low} to {high}°).",
        number(score.mean_deg)
    )
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
