//! Sentences that answer which controller is best in an evaluation: the ranking, the envelope, lost targets, and the weakest
//! group of targets.
//!
//! Controllers are ranked by the settled error, which is the attitude error that remains at the end of a flight to a target. A
//! flight keeps the envelope if load factor and angle of attack stay within their limits.

use super::label;
use crate::kit::numbers::number;
use greylag_sim::evaluation::{Evaluation, Score};

/// Group of targets over which controllers are ranked if the evaluation contains it.
const ALL: &str = "all";
/// A controller ranks behind the others if its fraction of flights that keep the envelope is more than this below the largest
/// one: one flight in twenty. A small settled error does not compensate for a load factor beyond the limit.
const KEPT_APART: f64 = 0.05;

/// The evaluation of the controller that ranks first; `None` if there are no scores.
pub fn best(evaluations: &[Evaluation]) -> Option<&Evaluation> {
    let [keeping, _] = ranked(evaluations, &ranked_over(evaluations)?);
    keeping.first().map(|(e, _)| *e)
}

/// Evaluations with their scores over `group`. The first list has the controllers that keep the envelope often enough, the
/// second the others. Each list is sorted by the mean settled error.
fn ranked<'a>(evaluations: &'a [Evaluation], group: &str) -> [Vec<(&'a Evaluation, &'a Score)>; 2] {
    let mut all: Vec<(&Evaluation, &Score)> =
        evaluations.iter().filter_map(|e| Some((e, e.score(group)?))).collect();
    all.sort_by(|(_, a), (_, b)| a.mean_deg.total_cmp(&b.mean_deg));
    let most = all.iter().map(|(_, s)| s.kept_rate).fold(f64::NAN, f64::max);
    // without quality measures this fraction is NaN and does not affect the ranking
    let (leaving, keeping) = all.into_iter().partition(|(_, s)| s.kept_rate < most - KEPT_APART);
    [keeping, leaving]
}

/// The sentences of the answer, beginning with the ranking; empty if there are no scores.
pub fn sentences(evaluations: &[Evaluation]) -> Vec<String> {
    let Some(group) = ranked_over(evaluations) else { return Vec::new() };
    let [keeping, leaving] = ranked(evaluations, &group);
    let Some((best, rest)) = keeping.split_first() else { return Vec::new() };
    let mut all = vec![ranking(*best, rest, &leaving)];
    let ranked = [&keeping[..], &leaving[..]].concat();
    let measured = ranked.iter().any(|(_, score)| score.kept_rate.is_finite());
    if measured {
        all.push(format!(
            "Envelope kept: {}.",
            each(&ranked, |s| format!("in {} of the flights", percent(s.kept_rate)))
        ));
    }
    all.push(match ranked.iter().all(|(_, s)| s.divergence_rate == 0.0) {
        true => "No target was lost.".into(),
        false => format!(
            "Targets lost (over 10° off): {}.",
            each(&ranked, |s| percent(s.divergence_rate))
        ),
    });
    all.extend(weakest(best.0));
    all
}

/// The group "all" (Table II of the paper) if the evaluation contains it, otherwise the group with most targets.
fn ranked_over(evaluations: &[Evaluation]) -> Option<String> {
    let groups = &evaluations.first()?.groups;
    let most = groups.iter().max_by_key(|score| score.count)?;
    let all = groups.iter().find(|score| score.targets == ALL);
    Some(all.unwrap_or(most).targets.clone())
}

fn ranking(
    (best, score): (&Evaluation, &Score),
    rest: &[(&Evaluation, &Score)],
    leaving: &[(&Evaluation, &Score)],
) -> String {
    let [low, high] = score.mean_ci95_deg.map(number);
    let targets = match score.count {
        1 => "1 target".into(),
        n => format!("{n} targets"),
    };
    let mut text = format!(
        "{}{}: settled error {}° on average over {targets} (95 %: {low} to {high}°)",
        match (rest, leaving) {
            ([], []) => "",
            (_, []) => "Best: ",
            _ => "Best of those that keep the envelope: ",
        },
        label(best),
        number(score.mean_deg)
    );
    if let Some(((next, other), others)) = rest.split_first() {
        let apart = other.mean_ci95_deg[0] > score.mean_ci95_deg[1];
        let than = if apart { "next" } else { "not distinguished by these targets from" };
        text += &format!("; {than} {} {}°", label(next), number(other.mean_deg));
        others.iter().for_each(|(e, s)| text += &format!(", {} {}°", label(e), number(s.mean_deg)));
    }
    let behind = |s: &Score| format!("{}°", number(s.mean_deg));
    if !leaving.is_empty() {
        text += &format!(
            "; behind it, since they leave the envelope more often: {}",
            each(leaving, behind)
        );
    }
    text + "."
}

fn each(ranked: &[(&Evaluation, &Score)], of: impl Fn(&Score) -> String) -> String {
    let said: Vec<String> =
        ranked.iter().map(|(e, score)| format!("{} {}", label(e), of(score))).collect();
    said.join(", ")
}

/// Sentence on the largest error of the best controller, with the group of the target if there are several groups. `None` if
/// there is no group besides `all`.
fn weakest(best: &Evaluation) -> Option<String> {
    let groups = || best.groups.iter().filter(|s| s.targets != ALL);
    let worst = groups().max_by(|a, b| a.max_deg.total_cmp(&b.max_deg))?;
    let group = match groups().count() {
        1 => String::new(),
        _ => format!(" on {}", worst.targets.replace('_', " ")),
    };
    Some(format!("{} is worst{group}: {}° on one target.", label(best), number(worst.max_deg)))
}

fn percent(share: f64) -> String {
    format!("{} %", number(100.0 * share))
}
