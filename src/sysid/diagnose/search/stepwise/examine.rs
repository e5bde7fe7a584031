//! The checks of the best candidate.

use super::found::{Found, Selected};
use crate::diagnose::options::Options;
use crate::diagnose::regression::rank::Score;
use crate::diagnose::search::checks;
use crate::diagnose::search::round::Round;
use crate::diagnose::search::unexplained::explained;

/// Least fall of the error on held-out segments.
pub const HELD_OUT: f64 = 0.1;
/// Least share of bootstraps in which the effect, or one of its class, is the best.
pub const SELECTED: f64 = 0.8;
/// Precision of the formula of an effect that is not linear in its constants: whatever takes a smaller part of
/// what such an effect took before may be no more than its error.
const PRECISION: f64 = 2e-3;
/// Least share of a channel's variance that an effect must explain to be material. A delay of 10 ms explains
/// 2e-4 of it.
const MATERIAL: f64 = 1e-4;
/// Least share of a channel's error beyond noise that an effect must take to be material beside others.
const MATERIAL_BESIDE: f64 = 0.02;
/// A candidate whose contribution is this much like another's can take its place.
const RIVAL: f64 = 0.3;

/// The best candidate, if its evidence exceeds the threshold, with all its checks.
pub(super) fn examine(found: &Found, options: &Options) -> Option<Selected> {
    let round = found.round();
    let (place, score) = found.scores.first()?;
    if score.evidence.partial_cmp(&found.threshold)? != std::cmp::Ordering::Greater {
        return None;
    }
    let trial = &round.trials[*place];
    let mut refused = Vec::new();
    if round.at_bound(*place, score) {
        refused.push("a constant lies at the end of what is physically possible".into());
    }
    let class = class(found);
    let members: Vec<usize> =
        std::iter::once(*place).chain(class.iter().map(|k| found.scores[*k].0)).collect();
    let heldout = checks::heldout_reduction(round, trial, score);
    let relieves = checks::relieves(round, score);
    let slight = (heldout < HELD_OUT || heldout.is_nan()) && !relieves;
    if slight {
        refused.push(under("it takes", heldout, "of the error on held-out segments", HELD_OUT));
    }
    // what explains something else would be selected besides, not in its place
    let rival = |(t, other): &&(usize, Score)| {
        !found.beaten.contains(t) && checks::likeness(round, score, other).abs() > RIVAL
    };
    let open: Vec<usize> = found.scores.iter().filter(rival).map(|(t, _)| *t).collect();
    let selected = checks::selected(round, &open, &members, options.bootstraps);
    if selected < SELECTED && options.bootstraps > 0 {
        refused.push(under("it is the best in", selected, "of the block bootstraps", SELECTED));
    }
    // what relieves the prior takes its strain, which no formula's error is
    refused.extend(hidden(found, score).filter(|_| !relieves));
    let by_flight = checks::by_flight(round, trial, score);
    let first = trial.points[score.point].free[0].0;
    if checks::contradict(score.values[first], &by_flight) {
        refused.push("the flights contradict one another about its amount".into());
    }
    let contribution = round.contribution(score);
    let trace = match refused.is_empty() && !relieves {
        true => immaterial(found, round, score),
        false => None,
    };
    refused.extend(trace.clone());
    Some(Selected {
        id: trial.id,
        score: score.clone(),
        threshold: found.threshold,
        class: class.iter().map(|k| round.trials[found.scores[*k].0].id.to_owned()).collect(),
        heldout,
        selected,
        by_flight,
        channels: round.channels_of(score),
        taken: round.taken_by(score),
        refused,
        slight,
        trace,
        relieves,
        curved: trial.points[score.point].contribution.is_some(),
        contribution,
    })
}

/// Places in the ranking of the candidates that the data cannot tell from the best one.
fn class(found: &Found) -> Vec<usize> {
    let mut class = checks::class(found.round(), &found.scores, 0);
    class.retain(|k| !found.beaten.contains(&found.scores[*k].0));
    // settled, they are as good: how they did where the model was linearised without them says no more
    let level = (1..found.scores.len()).filter(|k| found.level.contains(&found.scores[*k].0));
    let level: Vec<usize> = level.filter(|k| !class.contains(k)).collect();
    class.extend(level);
    class
}

/// Says so if a significant effect does not matter: in no channel does it explain [`MATERIAL`] of the variance
/// and [`MATERIAL_BESIDE`] of what the tuned model left beyond noise. What counts is by how much less is left with it in
/// the model and the known coefficients where they go then: evidence also holds what the prior and the noise of the
/// columns are credited with, which no channel shows.
fn immaterial(found: &Found, round: &Round, score: &Score) -> Option<String> {
    let taken = round.taken_by(score);
    let explained = explained(&found.first, &round.tuned_residual(), &round.residual_with(score));
    let of_channel = |c: usize| {
        let only = std::array::from_fn(|k| k == c);
        let share = (taken[c] / checks::excess(&found.first, &only).max(taken[c])).max(0.0);
        [if share.is_finite() { share } else { 0.0 }, explained[c]]
    };
    let shares: Vec<[f64; 2]> = (0..6).map(of_channel).collect();
    let matters = |[of_error, of_variance]: &[f64; 2]| {
        *of_error >= MATERIAL_BESIDE && *of_variance >= MATERIAL
    };
    let most = |k: usize| 100.0 * shares.iter().map(|s| s[k]).fold(0.0, f64::max);
    (!shares.iter().any(matters)).then(|| {
        format!(
            "trace: real or of the sampling, it explains at most {:.2} % of a channel's variance and {:.1} % of \
             a channel's error, under {:.2} % and {:.0} %",
            most(1),
            most(0),
            100.0 * MATERIAL,
            100.0 * MATERIAL_BESIDE
        )
    })
}

/// A refusal by a share that is less than it has to be.
fn under(verb: &str, share: f64, of: &str, least: f64) -> String {
    format!("{verb} {:.0} % {of}, under {:.0} %", 100.0 * share, 100.0 * least)
}

/// Says so if `score` may be an error of the formula of an effect that has been selected before.
fn hidden(found: &Found, score: &Score) -> Option<String> {
    let earlier = found.selected.iter().find(|s| s.curved && hides(s, score))?;
    Some(format!(
        "it takes less than {:.1} % of what {} took, whose formula is no more precise",
        100.0 * PRECISION,
        earlier.id
    ))
}

/// Whether `score` may be an error of what has been selected before.
fn hides(earlier: &Selected, score: &Score) -> bool {
    score.fall < PRECISION * earlier.score.fall
}
