//! One case from the hidden effect to the error on flights that the fit never saw.

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

/// Slower than this is not flight, m/s.
const SLOWEST: f64 = 5.0;

/// Values of effects' coefficients by the effects' ids.
type Starts = BTreeMap<String, Vec<f64>>;

/// State shared by all cases.
pub struct Bench {
    /// The model that flies as the simulator does: its file with its text.
    path: PathBuf,
    reference: String,
    craft: Craft,
    subject: Subject,
    controller: Box<dyn Controller>,
    /// Number of simulated nulls of each diagnosis; `None` is the usual number.
    nulls: Option<usize>,
}

/// The flights of a case.
pub struct Flown {
    /// The model to start from.
    pub model: GreyBox,
    /// Flights to fit on.
    pub training: Vec<Reconstruction>,
    /// Flights to test on.
    pub testing: Vec<Reconstruction>,
    /// How long flying, logging and reconstructing took, s.
    seconds: f64,
}

impl Bench {
    /// Designs the controller that flies all cases with the simulator's `aircraft`, of which the file at `path` is the
    /// model; every diagnosis simulates so many `nulls`.
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
        })
    }

    /// The sizes of the aircraft.
    pub fn craft(&self) -> &Craft {
        &self.craft
    }

    /// Flies a case and reconstructs its logs; test flights are left out of nulls.
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
        let testing = if case.factor == 0.0 { &[][..] } else { &logs.testing };
        let all = |logs: &[Log]| logs.iter().map(|log| rebuilt(log, &model)).collect::<Result<_>>();
        let (training, testing) = (all(&logs.training)?, all(testing)?);
        Ok(Flown { model, training, testing, seconds: begun.elapsed().as_secs_f64() })
    }

    /// Diagnoses a flown case, amends the model, and judges it.
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
    if case.factor == 0.0 {
        return Ok(());
    }
    let begun = Instant::now();
    judge(record, case, flown, &answer)?;
    record.seconds.amend = begun.elapsed().as_secs_f64();
    Ok(())
}

/// The fits of the tuned prior, of what was asserted and of what is true, on flights unseen.
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
    // from where the diagnosis has it; what it has not found, from the truth
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
    // an effect that cannot be fitted stays out of the model, as `amend` leaves it out
    let error = |ids: &[String]| {
        let fit = fits.get(&sorted(ids.to_vec())).or_else(|| fits.get(&Vec::new()));
        held_out::error(fit.map_or(&flown.model, |fit| &fit.model), &testing)
    };
    // without the truth's own fit there is nothing to compare with
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

/// The output-error fit of `model` with the effects `ids`, each joined at its start.
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

/// Values of an effect's coefficients from which a search may start: those known, else clear ones.
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

/// The fitted parameters of `missing` beside the hidden ones; those hidden as zero are left out, for
/// an error in per cent means nothing there.
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

/// All seconds of a case.
pub fn total(seconds: &Seconds) -> f64 {
    seconds.flights + seconds.diagnose + seconds.amend
}
