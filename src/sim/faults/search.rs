//! Search for flights that violate a flight rule. A new flight is drawn at random, or it is a variation of the earlier flight
//! that came closest to violating a rule (PGFuzz, Kim et al., NDSS 2021). At the end, each violating flight is simplified as
//! long as the violation remains. The robustness of a flight is its margin to a violation, −1..1; it is negative if the rule is
//! violated.

use std::ops::ControlFlow;

use rand::RngExt;
use rand::seq::IndexedRandom;
use rayon::prelude::*;

use super::counterpart::Counterpart;
use super::flight::{CompanionFactory, FaultsError};
use super::judge::{Finding, Found};
use super::policies::{Policy, Sample, policies};
use super::scenario::Scenario;
use greylag_flight::pilot::TICK_S;
use greylag_num::stream::stream;

/// Number of flights of a round. They run in parallel. The number is fixed to make the result independent of the number of
/// cores.
const TOGETHER: u64 = 16;
/// Fraction of the flights that are drawn at random although there is an earlier flight to vary.
const FRESH: f64 = 0.25;
/// Largest number of simplifications of a flight.
const ROUNDS: usize = 8;
/// Id of the random stream of the search.
const SEARCH: u64 = 61;

/// Result of the search for one rule, with the flight that came closest to violating it.
#[derive(Clone, Debug)]
pub struct Nearest {
    /// Name of the rule.
    pub policy: &'static str,
    /// Requirement of the rule as text.
    pub asks: &'static str,
    /// Number of flights to which the rule applied.
    pub flights: u64,
    /// Number of flights that violated the rule.
    pub broken: u64,
    /// Smallest robustness over all flights. Infinite if the rule applied to no flight.
    pub distance: f64,
    /// Time of the smallest robustness within its flight, s.
    pub at_s: f64,
    /// The flight with the smallest robustness, simplified if it violates the rule. `None` if the rule applied to no
    /// flight.
    pub scenario: Option<Scenario>,
}

/// Flies `scenario`. Returns for each rule the smallest robustness and the time at which it occurred, s. `None` for a rule that
/// does not apply to the simulated vehicle (`Counterpart`). If the program panics, the robustness of all applicable rules is −1.
///
/// # Errors
///
/// If a flight cannot be set up; `FaultsError` lists the reasons.
pub fn distances(
    factory: &CompanionFactory,
    rules: &[Policy],
    scenario: &Scenario,
) -> Result<Vec<Option<(f64, f64)>>, FaultsError> {
    let (samples, found) = factory.trace(scenario)?;
    Ok(judged(rules, scenario.counterpart, &samples, &found))
}

/// Computes the results of [`distances`] from the samples and findings of a flight with `counterpart`.
pub fn judged(
    rules: &[Policy],
    counterpart: Counterpart,
    samples: &[Sample],
    found: &[Found],
) -> Vec<Option<(f64, f64)>> {
    let panicked = found.iter().any(|f| f.finding == Finding::Panic);
    let judge = |rule: &Policy| {
        let applies = !rule.of_controllers || counterpart != Counterpart::Sitl;
        applies.then(|| nearest(rule, samples, panicked))
    };
    rules.iter().map(judge).collect()
}

fn nearest(rule: &Policy, samples: &[Sample], panicked: bool) -> (f64, f64) {
    let (place, distance) = rule.always.least(samples).unwrap_or((0, 1.0));
    if panicked {
        return (-1.0, samples.len() as f64 * TICK_S);
    }
    (distance, place as f64 * TICK_S)
}

/// Flies `flights` flights with companions of `factory` and searches for violations of the flight rules. A random flight has one
/// of the `counterparts` as its vehicle. `progress` receives the number of flights and of violated rules so far, and can cancel
/// the search.
///
/// # Errors
///
/// If a flight cannot be set up; `FaultsError` lists the reasons.
pub fn search(
    factory: &CompanionFactory,
    counterparts: &[Counterpart],
    flights: u64,
    seed: u64,
    progress: &mut dyn FnMut(u64, usize) -> ControlFlow<()>,
) -> Result<Vec<Nearest>, FaultsError> {
    let rules = policies(&factory.envelope());
    let begin = |rule: &Policy| Nearest {
        policy: rule.id,
        asks: rule.asks,
        flights: 0,
        broken: 0,
        distance: f64::INFINITY,
        at_s: 0.0,
        scenario: None,
    };
    let mut all: Vec<Nearest> = rules.iter().map(begin).collect();
    let mut flown = 0;
    while flown < flights {
        let together = TOGETHER.min(flights - flown);
        let next = |k: u64| {
            let mut random = stream(seed, &[SEARCH, flown + k]);
            let near: Vec<&Scenario> = all
                .iter()
                .filter_map(|n| n.scenario.as_ref().filter(|_| n.distance >= 0.0))
                .collect();
            match near.choose(&mut random) {
                Some(scenario) if !random.random_bool(FRESH) => scenario.varied(&mut random),
                _ => {
                    let counterpart = counterparts[random.random_range(0..counterparts.len())];
                    Scenario::drawn(counterpart, &mut random)
                }
            }
        };
        let scenarios: Vec<Scenario> = (0..together).map(next).collect();
        let judged: Result<Vec<_>, _> =
            scenarios.par_iter().map(|scenario| distances(factory, &rules, scenario)).collect();
        for (scenario, judged) in scenarios.iter().zip(judged?) {
            for (nearest, judged) in all.iter_mut().zip(judged) {
                nearest.take(scenario, judged);
            }
        }
        flown += together;
        if progress(flown, all.iter().filter(|n| n.broken > 0).count()).is_break() {
            break;
        }
    }
    for (k, nearest) in all.iter_mut().enumerate().filter(|(_, n)| n.broken > 0) {
        nearest.shrink(factory, &rules, k)?;
    }
    Ok(all)
}

impl Nearest {
    fn take(&mut self, scenario: &Scenario, judged: Option<(f64, f64)>) {
        let Some((distance, at_s)) = judged else { return };
        self.flights += 1;
        self.broken += u64::from(distance < 0.0);
        if distance < self.distance {
            (self.distance, self.at_s) = (distance, at_s);
            self.scenario = Some(scenario.clone());
        }
    }

    /// Simplifies the scenario step by step while rule `k` stays violated.
    fn shrink(
        &mut self,
        factory: &CompanionFactory,
        rules: &[Policy],
        k: usize,
    ) -> Result<(), FaultsError> {
        for _ in 0..ROUNDS {
            let Some(scenario) = &self.scenario else { return Ok(()) };
            let mut smaller = None;
            for candidate in scenario.smaller() {
                if let Some((distance, at_s)) = distances(factory, rules, &candidate)?[k]
                    && distance < 0.0
                {
                    smaller = Some((candidate, distance, at_s));
                    break;
                }
            }
            let Some((candidate, distance, at_s)) = smaller else { return Ok(()) };
            (self.distance, self.at_s) = (distance, at_s);
            self.scenario = Some(candidate);
        }
        Ok(())
    }
}
