//! Checks of the best candidate.

use super::found::{Found, Selected};
use crate::diagnose::options::Options;
use crate::diagnose::regression::rank::Score;
use crate::diagnose::search::checks;
use crate::diagnose::search::round::Round;
use crate::diagnose::search::unexplained::explained;

/// Least relative reduction of the error on held-out segments.
pub const HELD_OUT: f64 = 0.1;
/// Least share of bootstraps in which the effect, or one indistinguishable from it, is best.
pub const SELECTED: f64 = 0.8;
/// Precision of the formula of a nonlinear effect: a later effect with a smaller share of its reduction may only
/// correct the formula's error.
const PRECISION: f64 = 2e-3;
/// Least share of a channel's variance that a material effect explains. A delay of 10 ms explains 2e-4 of it.
const MATERIAL: f64 = 1e-4;
/// Least share of a channel's error beyond noise that a material effect removes beside others.
const MATERIAL_BESIDE: f64 = 0.02;
/// Correlation of contributions from which one candidate can replace another.
const RIVAL: f64 = 0.3;

/// The best candidate with all its checks, if its evidence exceeds the threshold.
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
    let absorbs_prior_error = checks::absorbs_prior_error(round, score);
    let slight = (heldout < HELD_OUT || heldout.is_nan()) && !absorbs_prior_error;
    if slight {
        refused.push(under("it takes", heldout, "of the error on held-out segments", HELD_OUT));
    }
    // a candidate that explains another part of the residual would be selected in addition, not instead
    let rival = |(t, other): &&(usize, Score)| {
        !found.beaten.contains(t) && checks::correlation(round, score, other).abs() > RIVAL
    };
    let open: Vec<usize> = found.scores.iter().filter(rival).map(|(t, _)| *t).collect();
    let selected = checks::selected(round, &open, &members, options.bootstraps);
    if selected < SELECTED && options.bootstraps > 0 {
        refused.push(under("it is the best in", selected, "of the block bootstraps", SELECTED));
    }
    // a candidate that absorbs prior misfit does not correct the error of a formula
    refused.extend(hidden(found, score).filter(|_| !absorbs_prior_error));
    let by_flight = checks::by_flight(round, trial, score);
    let (first, of_first) = &by_flight[0];
    if checks::contradict(score.values[*first], of_first) {
        refused.push("the flights contradict one another about its amount".into());
    }
    let contribution = round.contribution(score);
    let trace = match refused.is_empty() && !absorbs_prior_error {
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
        absorbs_prior_error,
        curved: trial.points[score.point].contribution.is_some(),
        contribution,
    })
}

/// Indices in the ranking of the candidates that the data cannot distinguish from the best one.
fn class(found: &Found) -> Vec<usize> {
    let mut class = checks::class(found.round(), &found.scores, 0);
    class.retain(|k| !found.beaten.contains(&found.scores[*k].0));
    // candidates that were as good in the run-off belong to the class, whatever their scores before tuning
    let level = (1..found.scores.len()).filter(|k| found.level.contains(&found.scores[*k].0));
    let level: Vec<usize> = level.filter(|k| !class.contains(k)).collect();
    class.extend(level);
    class
}

/// A remark if a significant effect is immaterial: in no channel does it explain [`MATERIAL`] of the variance and
/// [`MATERIAL_BESIDE`] of the tuned model's residual beyond noise. The measure is the reduction with the effect and
/// all coefficients re-estimated, because the evidence also includes reductions of the prior's misfit and of column
/// noise, which no channel shows.
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

/// Text of a refusal because a share is below its limit or, if NaN, cannot be computed.
fn under(verb: &str, share: f64, of: &str, least: f64) -> String {
    match share.is_nan() {
        true => format!("the share that {verb} {of} cannot be computed"),
        false => format!("{verb} {:.0} % {of}, under {:.0} %", 100.0 * share, 100.0 * least),
    }
}

/// A remark if `score` may only correct the formula of an effect selected before.
fn hidden(found: &Found, score: &Score) -> Option<String> {
    let earlier = found.selected.iter().find(|s| s.curved && hides(s, score))?;
    Some(format!(
        "it takes less than {:.1} % of what {} took, whose formula is no more precise",
        100.0 * PRECISION,
        earlier.id
    ))
}

/// Whether `score` may only correct the formula of the effect `earlier`.
fn hides(earlier: &Selected, score: &Score) -> bool {
    score.fall < PRECISION * earlier.score.fall
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_that_cannot_be_computed_is_said_to_be_so() {
        let of = |share| under("it takes", share, "of the error on held-out segments", HELD_OUT);
        assert_eq!(of(0.04), "it takes 4 % of the error on held-out segments, under 10 %");
        assert_eq!(
            of(f64::NAN),
            "the share that it takes of the error on held-out segments cannot be computed"
        );
    }
}
