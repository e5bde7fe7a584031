//! Minimum detectable effect: the smallest amount of each effect (a physical contribution to forces and moments) that the flights
//! would show. Evidence is the test statistic of an effect.
//!
//! For an effect that is linear in its coefficients, this amount follows from the standard deviations of the
//! coefficients. The contribution of an input effect is not proportional to its amount near zero: a small lag is
//! confounded with a clock error, and a small dead zone has no effect. Its contribution is therefore computed at
//! several amounts from the deflections of the flights. All nuisance parameters are projected out at each amount.

use std::collections::BTreeMap;

use nalgebra::DVector;

use crate::diagnose::regression::catalogue::Entry;
use crate::diagnose::regression::cells::Placed;
use crate::diagnose::regression::projected::Projected;
use crate::diagnose::regression::rank::{Draw, Trial, deviations};
use crate::diagnose::search::round::Round;
use greylag_model::GreyBox;

/// Largest number of amounts that are evaluated for an effect.
const TRIED: usize = 8;
/// Largest factor between one amount and the next.
const STRIDE: f64 = 8.0;
/// Exponent n in evidence ∝ amountⁿ that is assumed until two amounts have been evaluated.
const POWER: f64 = 2.0;
/// Limits of the exponent n that is computed from two amounts.
const POWERS: [f64; 2] = [0.5, 4.0];
/// The search ends if the ratio of the evidence to the required evidence differs from 1 by less than this value.
const CLOSE: f64 = 0.1;

/// Smallest detectable amounts of the candidates (effects that the model may lack) of `round`, by identifier. The amount is that
/// of the first free coefficient, in its unit. An effect of this amount has evidence above `threshold` with a probability of five
/// in six.
///
/// Candidates without a detectable amount are left out.
pub fn detectable(round: &Round, threshold: f64) -> BTreeMap<&'static str, f64> {
    let straight = round.trials.iter().filter(|t| t.points[0].contribution.is_none());
    let mut all: BTreeMap<&'static str, f64> =
        straight.filter_map(|t| Some((t.id, linear(round, t, threshold)?))).collect();
    all.extend(operators(round, threshold));
    all
}

fn linear(round: &Round, trial: &Trial, threshold: f64) -> Option<f64> {
    let columns: Vec<usize> = trial.points[0].free.iter().map(|f| f.1).collect();
    let shown = Shown::new(&round.projected, trial, &columns)?;
    let amount = shown.needed(threshold) * shown.alone;
    amount.is_finite().then_some(amount)
}

/// Quantities that determine which amount of an effect is detectable.
struct Shown {
    /// Standard deviation of the estimated amount due to white noise.
    alone: f64,
    /// Standard deviation of the amount that follows from the scatter between blocks, divided by `alone`; at least 1.
    scatter: f64,
    /// Penalty in the evidence: ln n for each free coefficient, with n independent samples.
    penalty: f64,
}

impl Shown {
    fn new(p: &Projected, trial: &Trial, columns: &[usize]) -> Option<Shown> {
        let null = Draw { total: DVector::zeros(p.width()), blocks: p.noise.clone() };
        let (alone, robust) = deviations(&p.grams(), &null, columns)?;
        let penalty = columns.len() as f64 * trial.support.max(2.0).ln();
        Some(Shown { alone, scatter: (robust / alone).max(1.0), penalty })
    }

    /// The smallest detectable amount, in units of `alone`. Its penalised gain and its Wald statistic exceed
    /// `threshold` even if noise reduces the estimate by one standard deviation.
    fn needed(&self, threshold: f64) -> f64 {
        let threshold = threshold.max(0.0);
        let by_gain = (threshold + self.penalty).sqrt();
        by_gain.max(threshold.sqrt() * self.scatter) + self.scatter
    }
}

/// Search for the smallest detectable amount of an input effect. The search varies its size: the amount, or the reciprocal of
/// the amount if larger amounts are weaker effects.
struct Sought<'a> {
    entry: &'a Entry,
    trial: &'a Trial,
    /// Smallest and largest physically possible size.
    bounds: [f64; 2],
    size: f64,
    /// A size that is not detectable, and the ratio of its evidence to the required evidence.
    hidden: Option<[f64; 2]>,
    /// A size that is detectable, and the ratio of its evidence to the required evidence.
    seen: Option<[f64; 2]>,
    /// The size evaluated last, and the ratio of its evidence to the required evidence.
    last: Option<[f64; 2]>,
    found: Option<f64>,
    /// Whether the effect of the present size cannot be added to the model, which ends the search.
    refused: bool,
}

impl<'a> Sought<'a> {
    fn new(entry: &'a Entry, trial: &'a Trial) -> Option<Sought<'a>> {
        let starts = entry.about.entry.map_or(&[][..], |e| e.starts);
        let (low, high) = entry.about.coefficients[0].bounds;
        let mut sought = Sought {
            entry,
            trial,
            bounds: [low, high],
            size: 0.0,
            hidden: None,
            seen: None,
            last: None,
            found: None,
            refused: false,
        };
        sought.size = sought.turned(starts.first()?[0]);
        let ends = [sought.turned(low), sought.turned(high)];
        sought.bounds = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        Some(sought)
    }

    /// Converts an amount to a size, or a size to an amount. A larger size is a stronger effect. The size equals the
    /// amount, except for a limit (on a rate, for example), for which it is 1/amount.
    fn turned(&self, x: f64) -> f64 {
        let starts = self.entry.about.entry.map_or(&[][..], |e| e.starts);
        let falls = starts.first().map(|s| s[0]) > starts.last().map(|s| s[0]);
        if falls { x.recip() } else { x }
    }

    /// Records `ratio`, the evidence at the present size divided by the required evidence. Then chooses the next size.
    fn tried(&mut self, ratio: f64) {
        if (ratio - 1.0).abs() < CLOSE {
            self.found = Some(self.size);
            return;
        }
        let ratio = ratio.max(1e-6);
        // at a bound the size does not change, so that no exponent follows from the two evaluations
        let other = self.last.filter(|[size, _]| *size != self.size);
        let power = other.map_or(POWER, |[size, before]| {
            ((ratio / before).ln() / (self.size / size).ln()).clamp(POWERS[0], POWERS[1])
        });
        self.last = Some([self.size, ratio]);
        let place = if ratio < 1.0 { &mut self.hidden } else { &mut self.seen };
        *place = self.last;
        let next = match (self.hidden, self.seen) {
            (Some([a, low]), Some([b, high])) => {
                let part = -low.ln() / (high / low).ln();
                a * (b / a).powf(part.clamp(0.1, 0.9))
            }
            _ => {
                let factor = ratio.powf(-1.0 / power).clamp(1.0 / STRIDE, STRIDE);
                self.size * factor
            }
        };
        self.size = next.clamp(self.bounds[0], self.bounds[1]);
    }

    /// Smallest detectable amount as far as it has been found; `None` if no evaluated size is detectable.
    fn amount(&self) -> Option<f64> {
        let size = self.found.or(self.seen.map(|[size, _]| size))?;
        Some(self.turned(size))
    }
}

fn operators(round: &Round, threshold: f64) -> Vec<(&'static str, f64)> {
    let of = |entry: &'_ Entry| round.trials.iter().position(|t| t.id == entry.about.id);
    let mut sought: Vec<Sought> = round
        .entries
        .iter()
        .filter(|e| e.operator)
        .filter_map(|e| Sought::new(e, &round.trials[of(e)?]))
        .collect();
    for _ in 0..TRIED {
        let is_open = |s: &Sought| s.found.is_none() && !s.refused;
        let open: Vec<usize> = (0..sought.len()).filter(|k| is_open(&sought[*k])).collect();
        if open.is_empty() {
            break;
        }
        let ratios =
            ratios(round, threshold, &open.iter().map(|k| &sought[*k]).collect::<Vec<_>>());
        let Some(ratios) = ratios else { break };
        for (k, ratio) in open.into_iter().zip(ratios) {
            match ratio {
                Some(ratio) => sought[k].tried(ratio),
                None => sought[k].refused = true,
            }
        }
    }
    sought.iter().filter_map(|s| Some((s.trial.id, s.amount()?))).collect()
}

/// For each effect of `sought`, the evidence at its present size divided by the required evidence. An entry is `None`
/// if the effect cannot be added to the model. The result is `None` if the regression fails.
fn ratios(round: &Round, threshold: f64, sought: &[&Sought]) -> Option<Vec<Option<f64>>> {
    let mut joined = Vec::with_capacity(sought.len());
    for s in sought {
        let mut with = round.model.clone();
        joined.push(with.join(s.trial.id, &[s.turned(s.size)]).ok().map(|()| (*s, with)));
    }
    of_those(joined, |joined| ratios_of(round, threshold, joined))
}

/// Evaluates the entries of `all` that are not `None`. The results keep their places; the other places are `None`.
fn of_those<T>(
    all: Vec<Option<T>>,
    evaluate: impl FnOnce(&[T]) -> Option<Vec<f64>>,
) -> Option<Vec<Option<f64>>> {
    let there: Vec<bool> = all.iter().map(Option::is_some).collect();
    let some: Vec<T> = all.into_iter().flatten().collect();
    let results = if some.is_empty() { Vec::new() } else { evaluate(&some)? };
    let mut results = results.into_iter();
    Some(there.into_iter().map(|there| if there { results.next() } else { None }).collect())
}

/// Evidence divided by the required evidence, for each effect of `sought`. The model of a pair contains the effect.
/// `None` if the regression fails.
fn ratios_of(round: &Round, threshold: f64, sought: &[(&Sought, GreyBox)]) -> Option<Vec<f64>> {
    let na = round.known.len();
    let last = na + sought.len();
    let mut placed: Vec<Placed> = Vec::new();
    for (flight, old) in round.flights.iter().zip(&round.placed) {
        let mut list: Placed = old.iter().take_while(|(p, _)| *p < na).cloned().collect();
        let columns = sought.iter().map(|(_, with)| flight.operator(with));
        list.extend(columns.enumerate().map(|(k, column)| (na + k, column)));
        list.push((last, flight.residual.clone()));
        placed.push(list);
    }
    let mut shared = round.shared();
    shared.truncate(na);
    let p = Projected::new(&round.cells, &placed, last, &round.known, &round.noise, &shared)?;
    let one = |(k, (s, _)): (usize, &(&Sought, GreyBox))| {
        // an effect without any contribution has the ratio 0
        let shown = Shown::new(&p, s.trial, &[k]).filter(|_| p.total[(k, k)] > 0.0);
        shown.map_or(0.0, |shown| 1.0 / (shown.alone * shown.needed(threshold)))
    };
    Some(sought.iter().enumerate().map(one).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::inputs::Kind;

    /// Result of the search for the effect `id` if the ratio of its evidence to the required evidence is a power of its
    /// size and reaches 1 at `amount`.
    fn sought(id: &str, amount: f64, power: f64) -> Option<f64> {
        let entry = Entry { about: Kind::from_id(id)?.describe(), operator: true };
        let id = entry.about.id;
        let trial = Trial { id, points: Vec::new(), support: 100.0, channels: [true; 6] };
        let mut sought = Sought::new(&entry, &trial)?;
        let size = sought.turned(amount);
        for _ in 0..TRIED {
            if sought.found.is_none() {
                let ratio = (sought.size / size).powf(power);
                sought.tried(ratio);
            }
        }
        sought.amount()
    }

    #[test]
    fn the_amount_is_found_however_fast_the_evidence_grows() {
        // the evidence of a lag confounded with a clock skew is quadratic, that of a dead zone linear
        for (id, amount) in [("actuator_lag", 2e-3), ("dead_zone", 1e-4), ("backlash", 0.1)] {
            for power in [1.0, 2.0] {
                let found = sought(id, amount, power).unwrap();
                assert!((found / amount - 1.0).abs() < 1.1 * CLOSE, "{id}: {found} for {amount}");
            }
        }
        // the lower a rate limit is, the stronger is its effect
        let found = sought("rate_limit", 3.0, 2.0).unwrap();
        assert!((found / 3.0 - 1.0).abs() < 1.1 * CLOSE, "{found}");
    }

    #[test]
    fn an_effect_that_cannot_join_does_not_end_the_search_for_the_others() {
        let evaluate = |some: &[f64]| Some(some.iter().map(|x| 2.0 * x).collect::<Vec<_>>());
        let ratios = of_those(vec![Some(1.0), None, Some(3.0)], evaluate);
        assert_eq!(ratios, Some(vec![Some(2.0), None, Some(6.0)]));
        assert_eq!(of_those(vec![None], evaluate), Some(vec![None]));
        assert_eq!(of_those(vec![Some(1.0), None], |_| None), None);
    }

    #[test]
    fn what_never_shows_has_no_amount() {
        // at the largest possible lag, the evidence is 1 % of the required evidence
        assert_eq!(sought("actuator_lag", 20.0, 2.0), None);
    }
}
