//! Checks of the best candidate (a physical effect that the model may lack) before it is added to the model. The evidence is the
//! test statistic by which candidates are ranked. The residual beyond noise is the residual sum of squares minus its expectation
//! for pure noise. A block is a stretch of about 4 s of a flight.

use super::found::{Found, Selected};
use crate::diagnose::options::Options;
use crate::diagnose::regression::rank::Score;
use crate::diagnose::search::checks;
use crate::diagnose::search::round::Round;
use crate::diagnose::search::unexplained::explained;

/// The effect must remove at least this share of the residual beyond noise in held-out blocks, which its fit did not use.
pub const HELD_OUT: f64 = 0.1;
/// The effect, or one that the flights cannot distinguish from it, must rank first in at least this share of block bootstraps.
pub const SELECTED: f64 = 0.8;
/// Relative precision of the formula of a nonlinear effect. A later effect may merely correct the error of this formula if it
/// reduces the residual by less than this share of the nonlinear effect's reduction.
const PRECISION: f64 = 2e-3;
/// To be asserted, an effect must explain at least this share of the variance of a channel (a force or moment). For comparison, a
/// delay of 10 ms explains 2e-4.
const MATERIAL: f64 = 1e-4;
/// To be asserted, an effect must remove at least this share of the residual beyond noise in the same channel.
const MATERIAL_BESIDE: f64 = 0.02;
/// Two candidates compete if the magnitude of the correlation of their contributions exceeds this value.
const RIVAL: f64 = 0.3;

/// The best candidate with the results of all checks. `None` if its evidence does not exceed the critical value.
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
    // a candidate that is not correlated with the best one explains another part of the residual and does not compete with it
    let rival = |(t, other): &&(usize, Score)| {
        !found.beaten.contains(t) && checks::correlation(round, score, other).abs() > RIVAL
    };
    let open: Vec<usize> = found.scores.iter().filter(rival).map(|(t, _)| *t).collect();
    let selected = checks::selected(round, &open, &members, options.bootstraps);
    if selected < SELECTED && options.bootstraps > 0 {
        refused.push(under("it is the best in", selected, "of the block bootstraps", SELECTED));
    }
    // a candidate that merely undoes changes of coefficients does not correct the error of a formula
    refused.extend(hidden(found, score).filter(|_| !absorbs_prior_error));
    let by_flight = checks::by_flight(round, trial, score);
    let (first, of_first) = &by_flight[0];
    if checks::contradict(score.values[*first], of_first, absorbs_prior_error) {
        refused.push("the flights contradict one another about its amount".into());
    }
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
        contribution: round.contribution(score),
    })
}

/// Indices in the ranking of the candidates that the flights cannot distinguish from the best candidate.
fn class(found: &Found) -> Vec<usize> {
    let mut class = checks::class(found.round(), &found.scores, 0);
    class.retain(|k| !found.beaten.contains(&found.scores[*k].0));
    // candidates that fitted equally well after they had been added to the model belong to the class too
    let level = (1..found.scores.len()).filter(|k| found.level.contains(&found.scores[*k].0));
    let level: Vec<usize> = level.filter(|k| !class.contains(k)).collect();
    class.extend(level);
    class
}

/// A remark if a significant effect is too small to be asserted: in no channel does it reach both [`MATERIAL`] and
/// [`MATERIAL_BESIDE`]. Otherwise `None`.
///
/// The reduction of the residual is computed from a joint estimate of the effect and all coefficients. The evidence would
/// overstate the effect, because it also contains deviations from the prior and noise in the regressors.
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

/// Text of an objection: `share` is below the limit `least`, or it is NaN because it cannot be computed.
fn under(verb: &str, share: f64, of: &str, least: f64) -> String {
    match share.is_nan() {
        true => format!("the share that {verb} {of} cannot be computed"),
        false => format!("{verb} {:.0} % {of}, under {:.0} %", 100.0 * share, 100.0 * least),
    }
}

/// An objection if the effect with this `score` may merely correct the formula of an effect that was selected earlier; otherwise
/// `None`.
fn hidden(found: &Found, score: &Score) -> Option<String> {
    let earlier = found.selected.iter().find(|s| s.curved && hides(s, score))?;
    Some(format!(
        "it takes less than {:.1} % of what {} took, whose formula is no more precise",
        100.0 * PRECISION,
        earlier.id
    ))
}

/// Whether the effect with this `score` may merely correct the formula of the effect `earlier`.
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
