//! Test of a proposed formula on held-out flights, which the search did not use: how much of the residual it removes, compared
//! with chance.

use super::draft::Term;
use super::forward::ORDER;
use super::result::HeldOut;
use crate::diagnose::Options;
use crate::diagnose::regression::catalogue::Entry;
use crate::diagnose::regression::rank::{Draw, quadratic};
use crate::diagnose::search::checks;
use crate::diagnose::search::nulls;
use crate::diagnose::search::round::{Beside, Problem, Round};
use crate::diagnose::search::stepwise::HELD_OUT;
use greylag_model::GreyBox;
use greylag_physics::formula::Written;

/// Fraction of the residual beyond noise that is removed in `channels` if the model `after` replaces the model `before`. The
/// residual beyond noise is the whitened sum of squares minus its expectation for pure noise. `None` if a model cannot be
/// evaluated over the flights.
///
/// Both residuals are whitened with the noise of `after`. Otherwise a better model would be penalised for its smaller noise.
pub(super) fn removed(
    problem: &Problem,
    before: &GreyBox,
    after: &GreyBox,
    channels: &[bool; 6],
) -> Option<f64> {
    let with = Round::new(problem, after.clone(), &[])?;
    let beside = Beside { noise: Some(&with.noise), ..Beside::default() };
    let without = Round::beside(problem, before.clone(), &[], beside)?;
    let [left, all] = [&with, &without].map(|round| checks::excess(round, channels));
    Some(1.0 - left / all.max(1.0))
}

/// Tests how much the formula `terms`, with fixed coefficients, reduces the residual of `model` on the held-out flights of
/// `problem`. `flights` are the names of these flights. `None` if the model cannot be evaluated over them.
pub(super) fn tested(
    problem: &Problem,
    model: &GreyBox,
    terms: &[Term],
    options: &Options,
    flights: Vec<String>,
) -> Option<HeldOut> {
    let effects: Vec<&'static Written> = terms.iter().filter_map(|t| t.form.fixed().ok()).collect();
    let entries: Vec<Entry> =
        effects.iter().map(|e| Entry { about: e.about, operator: false }).collect();
    let round = Round::new(problem, model.clone(), &entries)?;
    let grams = round.projected.grams();
    let weight =
        |id: &str| terms.iter().zip(&effects).find(|(_, e)| e.about.id == id).map(|(t, _)| t.value);
    let weights: Vec<(usize, f64)> =
        round.trials.iter().filter_map(|t| Some((t.points[0].free[0].1, weight(t.id)?))).collect();
    let square = quadratic(&weights, &weights, &grams.total);
    let fall =
        |draw: &Draw| 2.0 * weights.iter().map(|(c, w)| w * draw.total[*c]).sum::<f64>() - square;
    let measured = fall(&Draw::measured(&grams));
    let mut chance: Vec<f64> =
        (0..options.nulls).map(|k| fall(&nulls::draw(&round.projected, options.seed, k))).collect();
    chance.sort_by(f64::total_cmp);
    let channels = std::array::from_fn(|c| terms.iter().any(|t| t.form.channel == ORDER[c]));
    let mut with = model.clone();
    for (term, effect) in terms.iter().zip(&effects) {
        let mut values = vec![term.value];
        if effect.about.shape > 0 {
            values.extend(term.form.shape.constants());
        }
        with.join_most(effect.about.id, &values).ok()?;
    }
    let removed = removed(problem, model, &with, &channels)?;
    // the threshold is at least zero, because a negative reduction is not an improvement
    let threshold = chance.last().copied().unwrap_or(f64::INFINITY).max(0.0);
    Some(HeldOut { flights, removed, fall: measured, threshold })
}

/// Objection to the formula: on the held-out flights it reduces the residual no more than chance does, or by too small a
/// fraction. `None` if there is no objection.
pub(super) fn objection(tested: &HeldOut) -> Option<String> {
    if tested.fall <= tested.threshold {
        return Some(format!(
            "on flights that were not searched it takes no more than chance does (fall {:.0}, by chance {:.0})",
            tested.fall, tested.threshold
        ));
    }
    (tested.removed < HELD_OUT || tested.removed.is_nan()).then(|| {
        format!(
            "on flights that were not searched it removes {:.1} % of the error beyond noise, under {:.0} %",
            100.0 * tested.removed,
            100.0 * HELD_OUT
        )
    })
}
