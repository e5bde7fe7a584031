//! Acceptance of an effect, a group of terms that an amendment adds to a model. The effect must reduce the error of free runs
//! (simulations from recorded states) over held-out flights, which the fit did not use. Its fitted coefficients must be
//! plausible.

use super::amendment::{Added, Refused};
use super::error::AmendError;
use super::flight::Flight;
use super::leave_one_out::mean_with_error;
use super::output_error::Fit;
use super::parameters;
use super::result::{AddedEffect, Parameter};
use crate::compare::{HorizonScore, free_run};
use greylag_model::GreyBox;

/// Longest horizon (duration) of the free runs at which fits are compared, s.
pub const JUDGED_AT_S: f64 = 5.0;
/// Smallest relative decrease of the error over held-out flights for which an effect is accepted.
pub(super) const IMPROVED: f64 = 0.01;
/// An effect that reduces the error over held-out flights below this fraction of the error without it is accepted even if
/// its fit did not converge. Convergence may need further effects.
pub const ACCEPTED_UNCONVERGED: f64 = 0.5;
/// Half width of a 95 % interval in standard deviations. At least one coefficient of an effect must differ from zero by this
/// many standard deviations.
pub(super) const CLEAR: f64 = 1.96;
/// Takes the place of `CLEAR` for effects with more than three coefficients, because among many coefficients one can exceed
/// `CLEAR` by chance.
const CLEAR_OF_MANY: f64 = 3.0;
/// Smallest scaled error of a free run in a logarithm. Smaller errors are replaced by this value.
const LEAST_ERROR: f64 = 1e-12;
/// A flight contradicts the estimate from all flights if its own estimate differs by more than this number of standard
/// deviations of the difference, and by more than the relative difference [`DISAGREE_SHARE`].
const DISAGREE: f64 = 4.0;
/// Objection to an effect that cannot be judged, because no held-out flight is long enough for a free run.
const UNJUDGED: &str =
    "no flight that the fit did not see is long enough for a free run; hold out a longer one";
/// Relative difference from the estimate from all flights that a contradicting flight must exceed.
const DISAGREE_SHARE: f64 = 0.3;

impl AddedEffect {
    /// The record of the requested effect `id`, as it is before the fit.
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
    /// The held-out flights, which no fit used.
    pub test: &'a [Flight],
    /// Horizons of the free runs, s. Fits are compared at the longest one up to `JUDGED_AT_S`.
    pub horizons_s: &'a [f64],
}

/// An accepted fit with its held-out scores.
pub type Kept = (Fit, Vec<HorizonScore>);

impl Judge<'_> {
    /// Errors of `model` in free runs over the held-out flights, one entry for each horizon.
    pub fn scores(&self, model: &GreyBox) -> Vec<HorizonScore> {
        let flights: Vec<_> = self.test.iter().map(|f| f.prepared.clone()).collect();
        let (runs, _) = free_run::fly(model, &flights, self.horizons_s);
        self.horizons_s.iter().map(|h| runs.score(*h)).collect()
    }

    /// Mean of ln(error of `before` / error of `after`) over all free runs of `horizon_s` (s) over held-out flights, and its
    /// standard error. `before` and `after` are models. `None` if fewer than two runs reach the horizon.
    ///
    /// Because of the logarithm, a single diverged run does not outweigh all others. If runs are longer than the time between
    /// their starts, they overlap and are correlated. The standard error is therefore multiplied by the square root of the
    /// number of overlapping runs.
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

    /// Decides on the effect `added`. `fitted` is its fit, and `before` are the errors of the model without it over the held-out
    /// flights. `refused` states whether an effect with objections is added nevertheless. Returns the effect's record and, if
    /// the effect is added, the fit with its errors.
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

/// The scaled free-run error at the longest horizon up to [`JUDGED_AT_S`] that any run reaches; `None` if there is none.
pub fn judged(scores: &[HorizonScore]) -> Option<f64> {
    judge_of(scores).map(|s| s.rmse_scaled)
}

/// The longest horizon up to [`JUDGED_AT_S`] that any run reaches, s.
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

/// Whether the error in `after` at the horizon of [`judged`] is lower than that in `before` by more than 1 %.
pub fn better(after: &[HorizonScore], before: &[HorizonScore]) -> bool {
    judged(after).zip(judged(before)).is_some_and(|(a, b)| a < (1.0 - IMPROVED) * b)
}

/// Whether each coefficient of the effect `id` is confounded with a coefficient of the model without the effect: the flights
/// cannot separate the two.
pub fn doubled(id: &str, parameters: &[Parameter]) -> bool {
    let mut own = own(id, parameters).peekable();
    own.peek().is_some() && own.all(|p| p.same_as.is_some())
}

/// Phrase that names the coefficients of the model with which the effect `id` is confounded. It is empty unless each
/// coefficient of the effect is confounded.
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

/// Reasons, in words, to reject the effect `id` because of its fitted coefficients.
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

/// Notes on coefficients of the model itself whose fitted sign is opposite to that in the model file. The value must differ
/// from zero by 1.96 of its standard deviations, and from the file by more than the standard deviation in the file.
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

/// The first flight whose estimate of the coefficient contradicts the estimate from all flights, and the flight's estimate.
fn outlier(p: &Parameter) -> Option<(&str, f64)> {
    let far = |value: f64, sd: f64| {
        let off = (value - p.value).abs();
        off > DISAGREE * sd.hypot(p.sd) && off > DISAGREE_SHARE * p.value.abs()
    };
    let found = p.by_flight.iter().find(|e| far(e.value, e.sd));
    found.map(|e| (e.flight.as_str(), e.value))
}

/// Notes on coefficients of the model itself for which the estimate from one flight contradicts that from all flights.
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
