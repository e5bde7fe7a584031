//! List of the candidates, which are effects (physical contributions to forces and moments) that the model may lack, with their
//! estimates and the results of their checks. A candidate with enough evidence is asserted if it passes all checks, and refused
//! otherwise.

use std::collections::BTreeMap;

use crate::compare::ChannelId;
use crate::diagnose::answer::curves;
use crate::diagnose::answer::detectable::detectable;
use crate::diagnose::answer::result::{Candidate, FlightEstimate, Parameter, Status};
use crate::diagnose::options::{Detail, Options};
use crate::diagnose::regression::columns::Ready;
use crate::diagnose::regression::rank::{Score, Trial};
use crate::diagnose::search::checks;
use crate::diagnose::search::round::Round;
use crate::diagnose::search::stepwise::{Found, Selected};
use greylag_physics::catalogue::describe;
use greylag_physics::effects::Description;

/// Number of candidates that get a curve although they were not selected.
const RUNNERS_UP: usize = 2;
/// Half width of a 95 % interval in standard deviations.
const INTERVAL: f64 = 1.96;

/// Results of all candidates: first the asserted effects, then the refused ones, then all others by rank.
pub fn candidates(found: &Found, options: &Options) -> Vec<Candidate> {
    let (asserted, refused): (Vec<&Selected>, Vec<&Selected>) =
        found.selected.iter().partition(|s| s.refused.is_empty());
    let round = found.round();
    let least = least(found);
    let mut list: Vec<Candidate> =
        asserted.iter().chain(&refused).filter_map(|s| selected(found, s, options)).collect();
    for candidate in &mut list {
        candidate.minimum_detectable = least.get(candidate.id.as_str()).copied();
    }
    for (place, (trial, score)) in found.scores.iter().enumerate() {
        let trial = &round.trials[*trial];
        if list.iter().any(|c| c.id == trial.id) {
            continue;
        }
        let Some(about) = describe(trial.id) else { continue };
        let mut candidate = open(found, trial, score, &about);
        candidate.minimum_detectable = least.get(trial.id).copied();
        if round.at_bound(found.scores[place].0, score) {
            candidate
                .refused
                .push("a constant lies at the end of what is physically possible".into());
        }
        if options.detail == Detail::Full && place < RUNNERS_UP {
            candidate.curve = curves::curve(
                round,
                &round.contribution(score),
                &round.channels_of(score),
                relative(score),
                true,
            );
        }
        list.push(candidate);
    }
    list
}

/// Ids of those asserted effects whose coefficients may all be zero: in the joint fit of all effects, the 95 % intervals contain
/// zero. In such a case another effect explains the same residual. Shape constants (nonlinear coefficients) do not count.
pub fn void(found: &Found, options: &Options) -> Vec<String> {
    let lean = Options { detail: Detail::Lean, ..options.clone() };
    let asserted = found.selected.iter().filter(|s| s.refused.is_empty());
    let candidates = asserted.filter_map(|s| selected(found, s, &lean));
    let may_be_zero = |c: &Candidate| {
        let amounts = describe(&c.id).map_or(0, |about| about.coefficients.len() - about.shape);
        let mut own = c.parameters.iter().take(amounts.max(1)).peekable();
        own.peek().is_some() && own.all(|p| p.ci95[0] < 0.0 && 0.0 < p.ci95[1])
    };
    candidates.filter(may_be_zero).map(|c| c.id).collect()
}

/// Smallest detectable amounts by effect id. An effect that was added to the model keeps the amount from the first round of the
/// search, before any effect was added.
fn least(found: &Found) -> BTreeMap<&'static str, f64> {
    let mut least = detectable(&found.first, found.threshold);
    if let Some(last) = &found.last {
        least.extend(detectable(last, found.threshold));
    }
    least
}

/// Standard deviation of a fitted contribution relative to its value: 1/√(Wald statistic).
fn relative(score: &Score) -> f64 {
    score.wald.max(1e-9).sqrt().recip()
}

fn selected(found: &Found, s: &Selected, options: &Options) -> Option<Candidate> {
    let about = describe(s.id)?;
    let round = found.round();
    let parameters = about.coefficients.iter().enumerate().map(|(k, c)| {
        let [value, sd, sums] =
            fitted(found, s.id, c.name).unwrap_or([s.score.values[k], 0.0, 0.0]);
        // of two standard deviations, the larger one is used: that of the joint fit, or that of the round of the search that
        // selected the effect, which includes the scatter between blocks of data
        let fitted = parameter(&about, k, value, sd.max(s.score.deviations[k]).hypot(sums));
        Parameter { by_flight: of_coefficient(round, &s.by_flight, k), ..fitted }
    });
    let parameters = parameters.collect();
    let curve = match options.detail {
        Detail::Full => curves::curve(
            round,
            &s.contribution,
            &s.channels,
            relative(&s.score),
            !round.model.has(s.id),
        ),
        Detail::Lean => None,
    };
    Some(Candidate {
        id: s.id.into(),
        description: about.description,
        asserted: s.refused.is_empty(),
        status: match (s.refused.is_empty(), s.class.is_empty()) {
            (true, true) => Status::Missing,
            (true, false) => Status::Indistinguishable,
            _ if s.trace.is_some() => Status::Small,
            _ => Status::Refused,
        },
        evidence: s.score.evidence,
        threshold: s.threshold,
        parameters,
        channels: names(&s.channels),
        acts: Vec::new(),
        indistinguishable_from: s.class.clone(),
        heldout_error_reduction: s.heldout,
        selected_in_bootstraps: s.selected,
        by_flight: of_first(round, &s.by_flight),
        minimum_detectable: None,
        refused: s.refused.clone(),
        curve,
    })
}

/// Value of the coefficient `name` of the effect `id` in the model, its standard deviation due to noise, and that due to
/// discretisation. `None` if the model does not contain the effect.
fn fitted(found: &Found, id: &str, name: &str) -> Option<[f64; 3]> {
    let round = found.round();
    let full = format!("{id}.{name}");
    let place = round.model.coefficients().iter().position(|c| c.name == full)?;
    let tuned = round.tuned();
    let value = tuned.coefficients()[place].value;
    let sums = found.sums.get(place).copied().unwrap_or(0.0);
    match round.coefficients.iter().position(|k| *k == place) {
        None => Some([value, 0.0, 0.0]),
        Some(k) => {
            let p = &round.projected;
            Some([value, p.covariance[(k, k)].max(0.0).sqrt(), sums])
        }
    }
}

fn open(found: &Found, trial: &Trial, score: &Score, about: &Description) -> Candidate {
    let round = found.round();
    // the estimates by flight are only noise if the evidence is below the critical value
    let by_flight = match score.evidence > found.threshold {
        true => checks::by_flight(round, trial, score),
        false => Vec::new(),
    };
    let parameters = (0..about.coefficients.len())
        .map(|k| Parameter {
            by_flight: of_coefficient(round, &by_flight, k),
            ..parameter(about, k, score.values[k], score.deviations[k])
        })
        .collect();
    Candidate {
        id: trial.id.into(),
        description: about.description,
        asserted: false,
        status: match score.evidence > found.threshold {
            true => Status::Refused,
            false => Status::NotShown,
        },
        evidence: score.evidence,
        threshold: found.threshold,
        parameters,
        channels: names(&round.channels_of(score)),
        acts: Vec::new(),
        indistinguishable_from: Vec::new(),
        heldout_error_reduction: f64::NAN,
        selected_in_bootstraps: f64::NAN,
        by_flight: of_first(round, &by_flight),
        minimum_detectable: None,
        refused: Vec::new(),
        curve: None,
    }
}

fn parameter(about: &Description, k: usize, value: f64, sd: f64) -> Parameter {
    let c = &about.coefficients[k];
    Parameter {
        name: c.name.into(),
        value,
        ci95: [value - INTERVAL * sd, value + INTERVAL * sd],
        unit: c.unit.into(),
        by_flight: Vec::new(),
    }
}

fn names(channels: &[usize]) -> Vec<String> {
    const NAMES: [&str; 6] = ["D", "L", "Y", "l", "m", "n"];
    debug_assert_eq!(ChannelId::ALL[0], ChannelId::Drag);
    channels.iter().map(|c| NAMES[*c].to_owned()).collect()
}

/// Estimates of the first free coefficient, one for each flight. `all` holds the estimates of every free coefficient by its
/// index.
fn of_first(round: &Round, all: &[(usize, Vec<[f64; 2]>)]) -> Vec<FlightEstimate> {
    all.first().map_or_else(Vec::new, |(_, values)| flights(round, values))
}

/// Estimates of coefficient `k`, one for each flight; empty if the coefficient was not free.
fn of_coefficient(round: &Round, all: &[(usize, Vec<[f64; 2]>)], k: usize) -> Vec<FlightEstimate> {
    let own = all.iter().find(|(index, _)| *index == k);
    own.map_or_else(Vec::new, |(_, values)| flights(round, values))
}

fn flights(round: &Round, values: &[[f64; 2]]) -> Vec<FlightEstimate> {
    let of = |(flight, [value, sd]): (&Ready, &[f64; 2])| FlightEstimate {
        flight: flight.measured.name.clone(),
        value: *value,
        sd: *sd,
    };
    round.flights.iter().zip(values).map(of).collect()
}
