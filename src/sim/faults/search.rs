//! Search for flights that violate a rule: each step varies the flight closest to a violation (PGFuzz, Kim et al.,
//! NDSS 2021), and violating flights are reduced.

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

/// Flights per round in parallel; the result is the same on any number of cores.
const TOGETHER: u64 = 16;
/// Fraction of flights drawn at random.
const FRESH: f64 = 0.25;
/// Largest number of rounds of a reduction.
const ROUNDS: usize = 8;
/// Random stream of the search.
const SEARCH: u64 = 61;

/// Closest approach to the violation of a rule.
#[derive(Clone, Debug)]
pub struct Nearest {
    /// Name of the rule.
    pub policy: &'static str,
    /// Its requirement as text.
    pub asks: &'static str,
    /// Number of flights in which it was judged.
    pub flights: u64,
    /// Number of flights that violated it.
    pub broken: u64,
    /// Smallest robustness of all flights, 1 at most; negative when violated.
    pub distance: f64,
    /// Time of the minimum, s.
    pub at_s: f64,
    /// The flight of that distance, reduced if it violates the rule.
    pub scenario: Option<Scenario>,
}

/// Robustness and time (s) of its minimum of `scenario` for each applicable rule. A panic violates all.
///
/// # Errors
///
/// If the aircraft cannot be loaded.
pub fn distances(
    factory: &CompanionFactory,
    rules: &[Policy],
    scenario: &Scenario,
) -> Result<Vec<Option<(f64, f64)>>, FaultsError> {
    let (samples, found) = factory.trace(scenario)?;
    Ok(judged(rules, scenario.counterpart, &samples, &found))
}

/// Robustness of a flight with `counterpart` from its samples and findings.
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

/// Flies `flights` flights with companions of `factory` at the `counterparts`, steering towards violations of
/// `rules`. `progress` receives the numbers of flights and violations so far and can cancel the search.
///
/// # Errors
///
/// If the aircraft cannot be loaded.
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

    /// Removes everything from the scenario without which rule `k` is still violated.
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
