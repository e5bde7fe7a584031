//! Runs one test case: flies with the hidden effect, diagnoses and fits the model, and computes errors on held-out flights.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, anyhow};
use greylag::control::{Controller, ControllerKind, build};
use greylag::logs::Flight as Log;
use greylag::model::GreyBox;
use greylag::sim::design::{Suspect, alternatives};
use greylag::sim::missing::{Craft, Missing};
use greylag::sim::starting_model::starting_model;
use greylag::sim::trial::{Subject, Trial};
use greylag::sysid::amend::{self, Fit, FitOptions};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use greylag::sysid::weak_form::prepared::Prepared;
use greylag_sitl::plant::PlantOptions;

use crate::ask::{Answer, ask};
use crate::cases::Case;
use crate::held_out;
use crate::record::{Found, HeldOut, Record, Seconds};

/// Smallest airspeed of the samples that are used, m/s.
const SLOWEST: f64 = 5.0;

/// Values of the coefficients of effects, by the id of the effect.
type Starts = BTreeMap<String, Vec<f64>>;

/// State shared by all cases.
pub struct Bench {
    /// File of the model that matches the simulator. `reference` is its text.
    path: PathBuf,
    reference: String,
    craft: Craft,
    subject: Subject,
    controller: Box<dyn Controller>,
    /// Number of surrogate data sets without an effect in each diagnosis; `None` for the default number.
    nulls: Option<usize>,
    /// Whether fits and errors on held-out flights are left out.
    pub diagnose_only: bool,
}

/// The flights of a case.
pub struct Flown {
    /// The starting model of the diagnosis.
    pub model: GreyBox,
    /// Flights for the diagnosis and the fits.
    pub training: Vec<Reconstruction>,
    /// Held-out flights.
    pub testing: Vec<Reconstruction>,
    /// Computing time of flying, logging and reconstructing, s.
    seconds: f64,
}

impl Bench {
    /// Designs the controller that flies all cases with the simulator's `aircraft`. The model file at `path` matches this
    /// aircraft. `nulls` is the number of surrogate data sets in each diagnosis.
    pub fn new(path: &Path, aircraft: &str, nulls: Option<usize>) -> Result<Bench> {
        let model = GreyBox::load(path)?;
        let plant = PlantOptions { aircraft: aircraft.to_owned(), ..PlantOptions::default() };
        Ok(Bench {
            path: path.to_owned(),
            reference: std::fs::read_to_string(path)?,
            craft: Craft::of(&model),
            subject: Subject::new(plant, &model.airframe).map_err(|why| anyhow!("{why}"))?,
            controller: build(ControllerKind::Lqi, &model)?,
            nulls,
            diagnose_only: false,
        })
    }

    /// The factors that scale amplitudes to the aircraft.
    pub fn craft(&self) -> &Craft {
        &self.craft
    }

    /// Flies a case and reconstructs its logs. The test flights are omitted if no effect is hidden or nothing is fitted.
    pub fn fly(&self, case: &Case) -> Result<Flown> {
        let begun = Instant::now();
        let Case { seed, missing, .. } = case;
        let text = starting_model(&self.reference, "start", *seed, missing);
        let text = text.map_err(|why| anyhow!("making the model: {why}"))?;
        let model = GreyBox::parse(&text, &self.path)?;
        let trial = Trial {
            subject: self.subject.clone(),
            seed: *seed,
            missing: missing.clone(),
            turbulence: None,
            installed: case.installed().map(|(_, of)| of).unwrap_or_default(),
        };
        let logs = trial.fly(self.controller.as_ref())?;
        let testing =
            if case.factor == 0.0 || self.diagnose_only { &[][..] } else { &logs.testing };
        let all = |logs: &[Log]| logs.iter().map(|log| rebuilt(log, &model)).collect::<Result<_>>();
        let (training, testing) = (all(&logs.training)?, all(testing)?);
        Ok(Flown { model, training, testing, seconds: begun.elapsed().as_secs_f64() })
    }

    /// Diagnoses a flown case, fits the model with the asserted effects, and computes errors on held-out flights.
    pub fn search(&self, case: &Case, flown: &Flown) -> Record {
        let mut record = Record::of(case);
        record.seconds.flights = flown.seconds;
        if let Err(why) = fill(&mut record, case, flown, self) {
            record.failure = Some(format!("{why:#}"));
        }
        record
    }
}

fn rebuilt(log: &Log, model: &GreyBox) -> Result<Reconstruction> {
    let options = flight_path::Options {
        gravity: model.atmosphere.gravity,
        actuators_clock: ActuatorClock::AsRecorded,
        ..flight_path::Options::new(&log.name, model.airframe.actuators)
    };
    Ok(reconstruct(log, &options)?)
}

fn fill(record: &mut Record, case: &Case, flown: &Flown, bench: &Bench) -> Result<()> {
    let begun = Instant::now();
    let answer = ask(&flown.model, &flown.training, case, bench.nulls)?;
    record.seconds.diagnose = begun.elapsed().as_secs_f64();
    answer.write_into(record);
    if case.factor == 0.0 || bench.diagnose_only {
        return Ok(());
    }
    let begun = Instant::now();
    judge(record, case, flown, &answer)?;
    record.seconds.amend = begun.elapsed().as_secs_f64();
    Ok(())
}

/// Fits the starting model without further effects, with the asserted effects and with the true effects. Records the errors
/// of these fits on held-out flights.
fn judge(record: &mut Record, case: &Case, flown: &Flown, answer: &Answer) -> Result<()> {
    let flights: Vec<amend::Flight> = flown
        .training
        .iter()
        .map(|flight| amend::Flight::new(flight, SLOWEST))
        .collect::<Result<_, _>>()?;
    let testing: Vec<Prepared> = flown
        .testing
        .iter()
        .map(|flight| Prepared::new(flight, SLOWEST))
        .collect::<Result<_, _>>()?;
    let mut fits: BTreeMap<Vec<String>, Fit> = BTreeMap::new();
    let truth = case.truth();
    // fits start from the values of the diagnosis; effects that it did not find start from their true values
    let hidden = case.missing.iter().filter(|m| !m.values.is_empty());
    let mut starts: Starts = hidden.map(|m| (m.id.to_owned(), m.values.clone())).collect();
    starts.extend(answer.values.clone());
    for ids in [Vec::new(), truth.clone(), record.asserted.clone()] {
        if let Entry::Vacant(place) = fits.entry(sorted(ids)) {
            match fit(&flown.model, place.key(), &starts, &flights) {
                Ok(fit) => drop(place.insert(fit)),
                Err(why) => record.unfitted.push(format!("{}: {why:#}", place.key().join(", "))),
            }
        }
    }
    // if the effects cannot be fitted, the model without them is used, as in `greylag amend`
    let error = |ids: &[String]| {
        let fit = fits.get(&sorted(ids.to_vec())).or_else(|| fits.get(&Vec::new()));
        held_out::error(fit.map_or(&flown.model, |fit| &fit.model), &testing)
    };
    // without a fit of the true effects there is no reference error
    record.held_out = fits.contains_key(&sorted(truth.clone())).then(|| HeldOut {
        tuned: error(&[]),
        amended: error(&record.asserted),
        oracle: error(&truth),
    });
    if let Some(fit) = fits.get(&sorted(record.asserted.clone())) {
        let known = case.missing.iter().filter(|m| record.asserted.iter().any(|a| a == m.id));
        record.parameters = known.flat_map(|m| parameters(m, fit)).collect();
    }
    Ok(())
}

fn sorted(mut ids: Vec<String>) -> Vec<String> {
    ids.sort();
    ids
}

/// The output-error fit of `model` with the added effects `ids`, which start from the values in `starts`.
fn fit(model: &GreyBox, ids: &[String], starts: &Starts, flights: &[amend::Flight]) -> Result<Fit> {
    let mut with = model.clone();
    for id in ids {
        with.join(id, &start(model, id, starts)?)?;
    }
    let options = FitOptions { added: ids.to_vec(), ..FitOptions::default() };
    Ok(amend::output_error::fit(
        &with,
        flights,
        &options,
        &greylag::sysid::progress::ignore_progress,
    )?)
}

/// Starting values of an effect's coefficients: those in `starts` if they are valid, otherwise clearly visible values.
fn start(model: &GreyBox, id: &str, starts: &Starts) -> Result<Vec<f64>> {
    if let Some(values) = starts.get(id).filter(|v| model.clone().join(id, v).is_ok()) {
        return Ok(values.clone());
    }
    let suspect = Suspect { id: id.into(), values: Vec::new() };
    let ways = alternatives(model, &suspect)?;
    let first = ways.first().and_then(|way| way.first()).context("an effect without values")?;
    let own = first.coefficients().iter().filter(|c| c.name.starts_with(&format!("{id}.")));
    Ok(own.map(|c| c.value).collect())
}

/// The fitted coefficients of `missing` with their true values. Coefficients whose true value is zero are omitted, because
/// their relative error is undefined.
fn parameters(missing: &Missing, fit: &Fit) -> Vec<Found> {
    let own = |name: &str| name.starts_with(&format!("{}.", missing.id));
    let fitted = fit.parameters.iter().filter(|p| own(&p.name));
    let both = fitted.zip(&missing.values).filter(|(_, truth)| **truth != 0.0);
    both.map(|(p, truth)| Found {
        name: p.name.clone(),
        truth: *truth,
        value: p.value,
        ci95: p.ci95,
    })
    .collect()
}

/// Total computing time of a case, s.
pub fn total(seconds: &Seconds) -> f64 {
    seconds.flights + seconds.diagnose + seconds.amend
}
