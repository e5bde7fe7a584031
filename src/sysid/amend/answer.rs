//! Short answers (summaries) of an amendment, of a diagnosis, and of a comparison of models before and after an amendment. An
//! amendment re-estimates ("tunes") the coefficients of a model and adds effects (physical contributions to forces and moments)
//! that it lacks. A diagnosis finds these effects. Errors are those of free runs, simulations from recorded states.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::amendment::{Added, Options};
use super::document::{STORY, sha256};
use super::error::AmendError;
use super::quick::estimate;
use super::result::{Amendment, Parameter};
use crate::compare::answer::{Answer, Compared, Decisive, Method, Seen, Stage, Subject, Way};
use crate::compare::forecast::{self, ForecastResult};
use crate::compare::{Comparison, HorizonScore, Shares, scores, shares};
use crate::diagnose::{Candidate, Diagnosis, Parameter as Estimate};
use crate::flight_path::reconstruction::{Instant, Reconstruction};
use greylag_model::GreyBox;
use greylag_physics::catalogue;

/// The answer of an amendment, from the errors of three models on held-out flights: as given, tuned, and with the added
/// effects. `seen` states whether the held-out flights were also fitted. The baseline is the better of `forecasts`, forecasts without
/// aerodynamics of the held-out flights.
pub fn answer(story: &Amendment, seen: Seen, forecasts: &[ForecastResult]) -> Answer {
    let joined: Vec<_> = story.effects.iter().filter(|e| e.joined).collect();
    let effects = joined.iter().filter_map(|e| {
        let own = story.parameters.iter().filter(|p| p.added).map(Known::of);
        decisive(&e.id, e.description, own)
    });
    let stage = |way, scores| Stage { way, model: &story.model, scores };
    let mut stages =
        vec![stage(Way::Given, &story.given[..]), stage(Way::Tuned, &story.before[..])];
    if !joined.is_empty() {
        stages.push(stage(Way::Effects, &story.after[..]));
    }
    Answer::of(&Subject {
        stages,
        flights: story.held_out.clone(),
        seen,
        effects: effects.collect(),
        baseline: forecast::best(forecasts).map(|f| (f.name, &f.free_run[..])),
    })
}

/// The unexplained shares of the models `given`, `tuned` and `after` on `flights`. The coefficients were fitted by output error.
/// `None` if no flight can be compared.
pub fn compared(
    [given, tuned, after]: [&GreyBox; 3],
    flights: &[Reconstruction],
) -> Option<Compared> {
    let of = |model: &GreyBox| shares(model, flights).ok();
    Some(Compared {
        given: of(given),
        tuned: of(tuned),
        after: of(after)?,
        method: Method::OutputError,
    })
}

/// Whether the flights `held_out` are among the flights `fitted`. Names do not suffice: logs in two folders can have the same
/// name, and both parts of a split flight have the name of the flight. Both lists must be uncorrected reconstructions.
pub fn seen(fitted: &[Reconstruction], held_out: &[Reconstruction]) -> Seen {
    let (mut same, mut after) = (0, false);
    for held in held_out {
        let namesakes: Vec<&Reconstruction> =
            fitted.iter().filter(|f| f.name == held.name).collect();
        same += usize::from(namesakes.iter().any(|f| equal(f, held)));
        after |= namesakes.iter().any(|f| precedes(f, held));
    }
    if same == 0 && after { Seen::LastThird } else { Seen::Of(same) }
}

fn first(flight: &Reconstruction) -> Option<&Instant> {
    flight.segments.iter().find_map(|s| s.instants.first())
}

/// Whether two reconstructions are of the same part of the same flight. They then have equal length and equal first samples.
fn equal(one: &Reconstruction, other: &Reconstruction) -> bool {
    let count = |f: &Reconstruction| f.segments.iter().map(|s| s.instants.len()).sum::<usize>();
    let begin = first(one).zip(first(other));
    count(one) == count(other)
        && begin.is_some_and(|(a, b)| a.time_s == b.time_s && a.state == b.state)
}

/// Whether `one` ends before `other` begins, by the times in the log.
fn precedes(one: &Reconstruction, other: &Reconstruction) -> bool {
    let last = one.segments.iter().rev().find_map(|s| s.instants.last());
    last.zip(first(other)).is_some_and(|(a, b)| a.time_s < b.time_s)
}

/// The answer of a diagnosis, and the model with coefficients tuned to the flights of the diagnosis by equation error.
#[derive(Clone, Debug)]
pub struct Diagnosed {
    /// The model with tuned coefficients and without added effects.
    pub tuned: GreyBox,
    /// Summary: how much tuning, and all asserted effects together, reduce the free-run error on the flights of the diagnosis.
    pub answer: Answer,
}

/// Computes how much tuning and the asserted effects of `diagnosis` reduce the free-run error of `model` on `flights`, the
/// flights of the diagnosis. The baseline of the answer is the better of the forecasts that are not fitted: the held state, and
/// straight flight.
///
/// # Errors
/// If an effect cannot be added to the model, or a flight cannot be resampled.
pub fn diagnosed(
    model: &GreyBox,
    flights: &[Reconstruction],
    diagnosis: &Diagnosis,
) -> Result<Diagnosed, AmendError> {
    let asserted: Vec<_> = diagnosis.effects.iter().filter(|c| c.asserted).collect();
    let added: Vec<Added> = asserted.iter().map(|c| Added::of(c)).collect();
    let horizons_s = Options::default().horizons_s;
    let given = scores(model, flights, &horizons_s)?;
    let unfitted = forecast::unfitted(model, flights, &horizons_s)?;
    let tuned = estimate(model, flights, flights, &[])?;
    let stage = |way, scores| Stage { way, model: &diagnosis.model, scores };
    let mut stages = vec![stage(Way::Given, &given[..]), stage(Way::Tuned, &tuned.after[..])];
    let after = match added.is_empty() {
        true => None,
        false => Some(estimate(model, flights, flights, &added)?.after),
    };
    stages.extend(after.as_ref().map(|scores| stage(Way::Effects, &scores[..])));
    let answer = Answer::of(&Subject {
        stages,
        flights: flights.iter().map(|f| f.name.clone()).collect(),
        seen: Seen::Of(flights.len()),
        effects: asserted.iter().filter_map(|c| clearest(c)).collect(),
        baseline: forecast::best(&unfitted).map(|f| (f.name, &f.free_run[..])),
    });
    let answer = answer.acting(&diagnosis.compared());
    let said = diagnosis.sentences.first().filter(|_| asserted.is_empty());
    let answer = said.map_or(answer.clone(), |said| answer.with_effect(said.clone()));
    let mut tuned = tuned.model;
    tuned.name = "tuned".into();
    Ok(Diagnosed { tuned, answer })
}

/// The effect `c` with its coefficient that is most significantly different from zero; `None` if it has no coefficient.
fn clearest(c: &Candidate) -> Option<Decisive> {
    let clear = |p: &&Estimate| Decisive::clearness(p.value, p.ci95);
    let p = c.parameters.iter().max_by(|a, b| clear(a).total_cmp(&clear(b)))?;
    Some(Decisive {
        id: c.id.clone(),
        description: c.description.into(),
        coefficient: p.name.clone(),
        value: p.value,
        ci95: p.ci95,
        unit: unit(&c.id, &p.name).into(),
        alike: c.indistinguishable_from.clone(),
    })
}

/// Estimate of a coefficient, from a fit or from the file `amend.json`.
#[derive(Clone, Debug, Deserialize)]
struct Known {
    name: String,
    added: bool,
    value: f64,
    ci95: [Option<f64>; 2],
}

impl Known {
    fn of(p: &Parameter) -> Known {
        let Parameter { name, added, value, ci95, .. } = p;
        let ci95 = ci95.map(|end| end.is_finite().then_some(end));
        Known { name: name.clone(), added: *added, value: *value, ci95 }
    }
}

/// The coefficient of the effect `id` that is most significantly different from zero; `None` if `known` has none.
fn decisive(id: &str, description: &str, known: impl Iterator<Item = Known>) -> Option<Decisive> {
    let of = |p: Known| {
        let (effect, coefficient) = p.name.split_once('.')?;
        let ci95 = p.ci95.map(|end| end.unwrap_or(f64::NAN));
        (effect == id).then(|| Decisive {
            id: id.into(),
            description: description.into(),
            coefficient: coefficient.into(),
            value: p.value,
            ci95,
            unit: unit(id, coefficient).into(),
            alike: Vec::new(),
        })
    };
    let clear = |d: &Decisive| Decisive::clearness(d.value, d.ci95);
    known.filter_map(of).max_by(|a, b| clear(a).total_cmp(&clear(b)))
}

/// The unit of a coefficient of the catalogue's effect `id`; empty if it has none.
fn unit(id: &str, coefficient: &str) -> &'static str {
    let about = catalogue::describe(id);
    let of = about.and_then(|a| a.coefficients.iter().find(|c| c.name == coefficient));
    of.map_or("", |c| c.unit).trim_matches('-')
}

/// Origin of an amended model, read from the file `amend.json` in the model's folder.
#[derive(Clone, Debug, Deserialize)]
pub struct Origin {
    /// Name of the model before the amendment.
    model: String,
    effects: Vec<Effect>,
    parameters: Vec<Known>,
    tuned: Vec<Known>,
    logs: Vec<Log>,
}

#[derive(Clone, Debug, Deserialize)]
struct Effect {
    id: String,
    description: String,
    joined: bool,
}

#[derive(Clone, Debug, Deserialize)]
struct Log {
    sha256: String,
}

impl Origin {
    /// Reads the `amend.json` in the folder of the model file `model`. `None` if there is none, or if it states another model
    /// before the amendment than `before`.
    pub fn beside(model: &Path, before: &GreyBox) -> Option<Origin> {
        let text = std::fs::read_to_string(model.parent()?.join(STORY)).ok()?;
        let origin: Origin = serde_json::from_str(&text).ok()?;
        (origin.model == before.name).then_some(origin)
    }

    /// The model `before` with the coefficients that the amendment tuned without added effects. `None` if `before` lacks one of
    /// these coefficients.
    pub fn tuned(&self, before: &GreyBox) -> Option<GreyBox> {
        let mut tuned = before.clone();
        let set = |p: &Known| tuned.set_coefficient(&p.name, p.value);
        self.tuned.iter().all(set).then_some(tuned)
    }

    /// The answer of the comparison `c`, whose models are that before the amendment and the amended one. `tuned` holds the
    /// free-run errors of the tuned model without added effects, and its unexplained shares if they are known. `logs` holds the
    /// paths of the logs of the comparison.
    pub fn answer(
        &self,
        c: &Comparison,
        tuned: (&[HorizonScore], Option<Shares>),
        logs: &[PathBuf],
    ) -> Answer {
        let stage =
            |k: usize, way| Stage { way, model: &c.models[k].name, scores: &c.models[k].free_run };
        let joined: Vec<&Effect> = self.effects.iter().filter(|e| e.joined).collect();
        let mut stages = vec![stage(0, Way::Given)];
        match joined.is_empty() {
            true => stages.push(stage(1, Way::Tuned)),
            false => {
                stages.push(Stage { way: Way::Tuned, model: &c.models[0].name, scores: tuned.0 });
                stages.push(stage(1, Way::Effects));
            }
        }
        let effects = joined.iter().filter_map(|e| {
            decisive(&e.id, &e.description, self.parameters.iter().filter(|p| p.added).cloned())
        });
        Answer::of(&Subject {
            stages,
            flights: c.flights.iter().map(|f| f.name.clone()).collect(),
            seen: Seen::Of(logs.iter().filter(|log| self.fitted(log)).count()),
            effects: effects.collect(),
            baseline: None,
        })
        .acting(&Compared {
            given: Some(c.models[0].shares()),
            tuned: tuned.1,
            after: c.models[1].shares(),
            method: Method::OutputError,
        })
    }

    /// Whether the amendment was fitted to the log at `path`.
    fn fitted(&self, path: &Path) -> bool {
        let hash = std::fs::read(path).map(|content| sha256(&content));
        hash.is_ok_and(|hash| self.logs.iter().any(|log| log.sha256 == hash))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::amend::split;
    use crate::flight_path::reconstruction::Segment;
    use greylag_logs::Sampling;
    use greylag_physics::{Controls, State};

    fn flight(name: &str, roll: f64) -> Reconstruction {
        let instant = |k: usize| Instant {
            time_s: 0.01 * k as f64,
            state: State { roll, ..State::NEUTRAL },
            yaw: f64::NAN,
            controls: Controls::default(),
            command: None,
            specific_force: [0.0; 3],
            altitude: 0.0,
            density: 1.225,
        };
        Reconstruction {
            sampling: Sampling::Instants,
            segments: vec![Segment { instants: (0..30).map(instant).collect() }],
            ..Reconstruction::empty(name)
        }
    }

    #[test]
    fn flights_that_were_fitted_are_no_last_third() {
        let (a, b) = (flight("a.csv", 0.1), flight("b.csv", 0.2));
        let all = [a.clone(), b];
        assert_eq!(seen(&all, &all), Seen::Of(2));
        let [begin, end] = split(&a);
        assert_eq!(seen(&[begin], &[end]), Seen::LastThird);
        // another log of the same name, for instance in another folder, is not the fitted one
        assert_eq!(seen(&all, &[flight("a.csv", 0.3)]), Seen::Of(0));
    }
}
