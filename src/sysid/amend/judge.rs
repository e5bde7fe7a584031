//! Acceptance of an effect from free runs over held-out flights and from the estimates of its coefficients.

use super::amendment::{Added, Refused};
use super::error::AmendError;
use super::flight::Flight;
use super::leave_one_out::mean_with_error;
use super::output_error::Fit;
use super::parameters;
use super::result::{AddedEffect, Parameter};
use crate::compare::{HorizonScore, free_run};
use greylag_model::GreyBox;

/// Longest horizon of the free runs at which fits are compared, s.
pub const JUDGED_AT_S: f64 = 5.0;
/// Smallest relative decrease of the held-out error for which an effect is accepted.
pub(super) const IMPROVED: f64 = 0.01;
/// An effect that reduces the held-out error below this fraction of the previous error is accepted although the search has
/// not converged with it. Convergence may need further effects.
pub const ACCEPTED_UNCONVERGED: f64 = 0.5;
/// Half width of a 95 % interval in standard deviations. At least one coefficient of an effect must differ from zero by
/// this number of standard deviations.
pub(super) const CLEAR: f64 = 1.96;
/// Replaces `CLEAR` for effects with more than three coefficients. Among many coefficients, one can exceed `CLEAR` by
/// chance.
const CLEAR_OF_MANY: f64 = 3.0;
/// Smaller scaled errors of free runs are raised to this value before the logarithm is taken.
const LEAST_ERROR: f64 = 1e-12;
/// A flight contradicts the common estimate if its own estimate differs from it by more than this number of standard
/// deviations, and by more than [`DISAGREE_SHARE`].
const DISAGREE: f64 = 4.0;
/// Objection to an effect that cannot be validated, because no free run over held-out flights is long enough.
const UNJUDGED: &str =
    "no flight that the fit did not see is long enough for a free run; hold out a longer one";
/// A flight contradicts the common estimate only if the relative difference of its own estimate exceeds this.
const DISAGREE_SHARE: f64 = 0.3;

impl AddedEffect {
    /// The record of the requested effect `id` before its fit.
    pub fn asked_for(id: &str) -> AddedEffect {
        let about = parameters::describe(id).map(|(about, _)| about);
        AddedEffect {
            id: id.into(),
            description: about.map_or("", |a| a.description),
            joined: false,
            refused: Vec::new(),
            fly_next: about.and_then(|a| a.entry).map_or("", |e| e.separated_by).into(),
        }
    }
}

/// Evaluation of fits by free runs over held-out flights.
pub struct Judge<'a> {
    /// Held-out flights.
    pub test: &'a [Flight],
    /// Horizons of the free runs, s. Fits are compared at the longest one up to `JUDGED_AT_S`.
    pub horizons_s: &'a [f64],
}

/// An accepted fit with its held-out scores.
pub type Kept = (Fit, Vec<HorizonScore>);

impl Judge<'_> {
    /// Free-run errors of `model` over the held-out flights, with one entry for each horizon.
    pub fn scores(&self, model: &GreyBox) -> Vec<HorizonScore> {
        let flights: Vec<_> = self.test.iter().map(|f| f.prepared.clone()).collect();
        let (runs, _) = free_run::fly(model, &flights, self.horizons_s);
        self.horizons_s.iter().map(|h| runs.score(*h)).collect()
    }

    /// Mean of ln(scaled error of `before` / scaled error of `after`) over all held-out free runs of `horizon_s` (s), and
    /// its standard error.
    ///
    /// Because of the logarithm, a single diverged run does not outweigh all others. Runs overlap if they are longer than
    /// the time between their starts. The standard error is increased accordingly.
    ///
    /// `None` if fewer than two runs reach the horizon.
    pub fn decrease(&self, horizon_s: f64, before: &GreyBox, after: &GreyBox) -> Option<[f64; 2]> {
        let flights: Vec<_> = self.test.iter().map(|f| f.prepared.clone()).collect();
        let errors =
            |model| free_run::fly(model, &flights, &[horizon_s]).0.scaled_errors(horizon_s);
        let log = |error: f64| error.max(LEAST_ERROR).ln();
        let pairs = errors(before).into_iter().zip(errors(after));
        let less: Vec<f64> = pairs.map(|(before, after)| log(before) - log(after)).collect();
        let overlap = (horizon_s / free_run::START_EVERY_S).max(1.0);
        (less.len() > 1).then(|| mean_with_error(&less)).map(|[mean, e]| [mean, e * overlap.sqrt()])
    }

    /// Decides on the effect `added` from its fit `fitted` and the held-out scores `before` of the model without it.
    /// Returns the effect's record, and the fit with its scores if the effect is accepted.
    pub fn verdict(
        &self,
        added: &Added,
        fitted: Result<Fit, AmendError>,
        before: &[HorizonScore],
        refused: Refused,
    ) -> Result<(AddedEffect, Option<Kept>), AmendError> {
        let mut effect = AddedEffect::asked_for(&added.id);
        let fit = match fitted {
            Ok(fit) => fit,
            Err(why) if failed(&why) => {
                effect.refused.push(why.to_string());
                return Ok((effect, None));
            }
            Err(why) => return Err(why),
        };
        let after = self.scores(&fit.model);
        effect.refused = objections(&added.id, &fit.parameters);
        let errors = judged(&after).zip(judged(before));
        if !errors.is_some_and(|(a, b)| a < ACCEPTED_UNCONVERGED * b) {
            effect.refused.extend(fit.unsettled.clone());
        }
        match errors {
            Some((a, b)) if a.is_nan() || a >= (1.0 - IMPROVED) * b => {
                effect.refused.push(format!(
                    "free runs of {} s on flights that the fit did not see come no closer \
                     ({b:.5} without it, {a:.5} with it){}",
                    judged_at(before).unwrap_or(JUDGED_AT_S),
                    confounded_with_model(&added.id, &fit.parameters)
                ));
            }
            Some(_) => {}
            None => effect.refused.push(UNJUDGED.into()),
        }
        effect.joined = effect.refused.is_empty() || refused == Refused::Kept;
        let kept = effect.joined.then_some((fit, after));
        Ok((effect, kept))
    }
}

/// The result of a fit; `None` if the fit did not converge or its equations have no solution. Other errors are returned.
pub fn settled<T>(of: Result<T, AmendError>) -> Result<Option<T>, AmendError> {
    match of {
        Ok(of) => Ok(Some(of)),
        Err(why) if failed(&why) => Ok(None),
        Err(why) => Err(why),
    }
}

/// Whether a fit did not converge, or its equations have no solution.
fn failed(why: &AmendError) -> bool {
    matches!(why, AmendError::NotConverged { .. } | AmendError::Singular { .. })
}

/// The scaled free-run error at the longest horizon up to [`JUDGED_AT_S`] that a run reaches.
pub fn judged(scores: &[HorizonScore]) -> Option<f64> {
    judge_of(scores).map(|s| s.rmse_scaled)
}

/// The longest horizon up to [`JUDGED_AT_S`] that a run reaches, s.
pub fn judged_at(scores: &[HorizonScore]) -> Option<f64> {
    judge_of(scores).map(|s| s.horizon_s)
}

/// The longest horizon up to [`JUDGED_AT_S`] that at least two runs reach, s. With a single run the difference of two models
/// has no standard error.
pub fn repeated_at(scores: &[HorizonScore]) -> Option<f64> {
    longest(scores, 2).map(|s| s.horizon_s)
}

fn judge_of(scores: &[HorizonScore]) -> Option<&HorizonScore> {
    longest(scores, 1)
}

/// The score at the longest horizon up to [`JUDGED_AT_S`] that at least `runs` runs reach.
fn longest(scores: &[HorizonScore], runs: usize) -> Option<&HorizonScore> {
    let reached = scores.iter().filter(|s| s.runs >= runs && s.horizon_s <= JUDGED_AT_S + 1e-9);
    reached.max_by(|a, b| a.horizon_s.total_cmp(&b.horizon_s))
}

/// Whether the error `after` is lower than `before` by more than 1 %.
pub fn better(after: &[HorizonScore], before: &[HorizonScore]) -> bool {
    judged(after).zip(judged(before)).is_some_and(|(a, b)| a < (1.0 - IMPROVED) * b)
}

/// Whether every coefficient of the effect `id` is confounded with a coefficient of the model before the effect was added.
pub fn doubled(id: &str, parameters: &[Parameter]) -> bool {
    let mut own = own(id, parameters).peekable();
    own.peek().is_some() && own.all(|p| p.same_as.is_some())
}

/// Phrase that names the model's coefficients confounded with the effect `id`. Empty unless every coefficient of the effect
/// is confounded.
fn confounded_with_model(id: &str, parameters: &[Parameter]) -> String {
    if !doubled(id, parameters) {
        return String::new();
    }
    let mut said: Vec<&str> = own(id, parameters).filter_map(|p| p.same_as.as_deref()).collect();
    said.sort_unstable();
    said.dedup();
    format!(", because it is confounded with {} of the model", said.join(", "))
}

/// The coefficients of the added effect `id`.
fn own<'a>(id: &'a str, parameters: &'a [Parameter]) -> impl Iterator<Item = &'a Parameter> {
    let of =
        move |p: &&Parameter| p.added && p.name.split_once('.').is_some_and(|(own, _)| own == id);
    parameters.iter().filter(of)
}

/// Reasons to reject the fitted coefficients of the effect `id`.
pub fn objections(id: &str, parameters: &[Parameter]) -> Vec<String> {
    let own: Vec<&Parameter> = own(id, parameters).collect();
    let mut objections = Vec::new();
    for p in own.iter().filter(|p| p.at_bound) {
        objections.push(format!(
            "{} ends at the bound {} of what is physically possible",
            p.name, p.value
        ));
    }
    let clear = if own.len() > 3 { CLEAR_OF_MANY } else { CLEAR };
    if !own.is_empty() && own.iter().all(|p| p.value.abs() < clear * p.sd) {
        let all: Vec<String> =
            own.iter().map(|p| format!("{} = {:.3e} ± {:.1e}", p.name, p.value, p.sd)).collect();
        objections.push(format!("the interval holds zero: {}", all.join(", ")));
    }
    for p in own {
        if let Some((flight, value)) = outlier(p) {
            objections.push(format!(
                "the flights contradict one another: {} is {:.3e} over all, {value:.3e} by {flight}",
                p.name, p.value
            ));
        }
    }
    objections
}

/// Advice, in words, on coefficients that end at a bound and do not belong to an added effect.
pub fn at_bounds(parameters: &[Parameter]) -> Vec<String> {
    let ended = parameters.iter().filter(|p| p.at_bound && !p.added);
    ended
        .map(|p| {
            let cure = match p.value == 0.0 {
                true => format!(
                    "the flights give the opposite sign or do not separate it from the rest; check the sign of that control in \
                     the mapping, or hold {} by a smaller sd in the model file",
                    p.name
                ),
                false => format!(
                    "the others make up for what it lacks, and its interval is none; lift it with --bound {}={}",
                    p.name,
                    wider(p.value)
                ),
            };
            format!("{} ends at its bound {}: {cure}", p.name, p.value)
        })
        .collect()
}

/// A range of ± twice the bound, in the syntax of the option `--bound`.
fn wider(bound: f64) -> String {
    let far = 2.0 * bound.abs();
    format!("-{far}..{far}")
}

/// Notes on coefficients whose sign is significantly opposite to that of their prior mean, with a change of more than the
/// prior standard deviation.
pub fn against_prior(parameters: &[Parameter]) -> Vec<String> {
    let turned = |p: &&Parameter| {
        !p.added
            && p.value * p.prior < 0.0
            && (p.value - p.prior).abs() > p.prior_sd
            && p.value.abs() > CLEAR * p.sd
    };
    parameters
        .iter()
        .filter(turned)
        .map(|p| {
            format!(
                "{} has come out as {:.4} where the model file has {:.4} ± {:.4}: a control or a sensor of the other sign \
                 looks like this; check the mapping of the logs",
                p.name, p.value, p.prior, p.prior_sd
            )
        })
        .collect()
}

/// The first flight whose own estimate contradicts the estimate from all flights, and this own estimate.
fn outlier(p: &Parameter) -> Option<(&str, f64)> {
    let far = |value: f64, sd: f64| {
        let off = (value - p.value).abs();
        off > DISAGREE * sd.hypot(p.sd) && off > DISAGREE_SHARE * p.value.abs()
    };
    let found = p.by_flight.iter().find(|e| far(e.value, e.sd));
    found.map(|e| (e.flight.as_str(), e.value))
}

/// Notes on coefficients whose estimate from one flight contradicts the estimate from all flights.
pub fn contradictions(parameters: &[Parameter]) -> Vec<String> {
    let named = parameters.iter().filter(|p| !p.added);
    named
        .filter_map(|p| {
            let (flight, value) = outlier(p)?;
            Some(format!(
                "{} is {:.4} over all flights, but {value:.4} by {flight} alone: something differed \
                 in that flight (loading, wind, damage); fit it apart, or fly it again",
                p.name, p.value
            ))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::amend::normal::Weights;
    use std::path::Path;

    #[test]
    fn an_effect_that_no_held_out_flight_can_judge_is_refused() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        let fit = Fit {
            model: GreyBox::load(&path).unwrap(),
            parameters: Vec::new(),
            flights: Vec::new(),
            residual_sd: [0.0; 8],
            shots: 0,
            weakened: 0,
            left: Vec::new(),
            weights: Weights { output: [1.0; 8], start: [1.0; 8] },
            iterations: 1,
            unsettled: None,
            notes: Vec::new(),
        };
        let judge = Judge { test: &[], horizons_s: &[1.0] };
        let added = Added { id: "motor_torque".into(), start: None };
        let (effect, kept) = judge.verdict(&added, Ok(fit), &[], Refused::Left).unwrap();
        assert_eq!((effect.refused.as_slice(), effect.joined), (&[UNJUDGED.to_owned()][..], false));
        assert!(kept.is_none());
    }
}
