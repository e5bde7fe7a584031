//! The diagnosis itself: flights in, answer out.

use crate::diagnose::answer::advice;
use crate::diagnose::answer::decoys;
use crate::diagnose::answer::measurement;
use crate::diagnose::answer::per_flight;
use crate::diagnose::answer::ranking;
use crate::diagnose::answer::result::{Diagnosis, Nulls, Settings, Verdict};
use crate::diagnose::answer::sentences;
use crate::diagnose::answer::shares;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::options::{Detail, Options};
use crate::diagnose::regression::catalogue;
use crate::diagnose::regression::sensors;
use crate::diagnose::regression::shared;
use crate::diagnose::search::excitation;
use crate::diagnose::search::round::Problem;
use crate::diagnose::search::stepwise::{Found, search};
use crate::flight_path::reconstruction::Reconstruction;
use crate::progress::{Progress, say};
use crate::rudder;
use crate::weak_form::prepared::Prepared;
use greylag_model::{GreyBox, RUDDER};
use greylag_physics as physics;

/// Least share of the error beyond noise that must be learnable before something is said to be missing:
/// what the reconstruction leaves is no effect.
const WORTH_SAYING: f64 = 0.1;

/// Says which effects of the catalogue `model` lacks according to `flights`, which must have been
/// reconstructed with their deflections as recorded; `progress` hears what is being done.
///
/// # Errors
/// There is too little flight or nothing in it moves, an id to be left out is unknown, or a flight has
/// no clock, or `progress` ended it.
pub fn diagnose(
    model: &GreyBox,
    flights: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Diagnosis, DiagnoseError> {
    known(&options.without)?;
    known(&options.with)?;
    let (problem, used, mut notes) = problem(model, flights, options)?;
    notes.extend(excitation::check(&problem.flights)?);
    let mut found = search(&problem, model, options, progress)?;
    say(progress, "what is left", 0.95)?;
    let rudder = rudder::unmodelled(flights, model);
    if let Some(motion) = rudder {
        found.refuse_in(&rudder::CHANNELS, RUDDER, &rudder::reason(motion));
    }
    let effects = ranking::candidates(&found, options);
    let channels = shares::channels(&found);
    let mut measurement = measurement::measurement(&used);
    measurement.extend(per_flight::angles(found.round()));
    let trims = per_flight::trims(found.round());
    let verdict = verdict(&found);
    notes.extend(sentences::notes(&found, model, options));
    let decoys = match options.detail {
        Detail::Full => decoys::decoys(&found, options.seed),
        Detail::Lean => Vec::new(),
    };
    Ok(Diagnosis {
        schema: "greylag.diagnosis/1",
        version: env!("CARGO_PKG_VERSION"),
        model: model.name.clone(),
        verdict,
        sentences: rudder
            .map(rudder::warning)
            .into_iter()
            .chain(sentences::sentences(&found, verdict, &effects, &channels, &measurement))
            .chain(per_flight::sentences(&measurement, &trims))
            .collect(),
        advice: advice::advice(&found, verdict, &effects, &channels),
        effects,
        channels,
        measurement,
        trims,
        tuned: shares::tuned(&found, model),
        nulls: Nulls { count: options.nulls, best: found.nulls.clone(), level: options.level },
        decoys,
        learnable_remainder: found.learnable(),
        notes,
        settings: Settings {
            seed: options.seed,
            nulls: options.nulls,
            bootstraps: options.bootstraps,
            without: options.without.clone(),
            per_flight: options.per_flight,
        },
    })
}

/// Whether every id is one of the catalogue.
pub fn known(ids: &[String]) -> Result<(), DiagnoseError> {
    match ids.iter().find(|id| physics::catalogue::describe(id).is_none()) {
        None => Ok(()),
        Some(id) => Err(DiagnoseError::UnknownEffect { id: id.clone() }),
    }
}

/// The problem, the flights it is made of, what the reader must know.
pub type Intake<'a> = (Problem, Vec<&'a Reconstruction>, Vec<String>);

/// The flights on the model's clock, with what was left out.
pub fn problem<'a>(
    model: &GreyBox,
    flights: &'a [Reconstruction],
    options: &Options,
) -> Result<Intake<'a>, DiagnoseError> {
    if flights.is_empty() {
        return Err(DiagnoseError::NoFlight);
    }
    let slowest = model.airframe.envelope.flying_from_mps();
    let (mut prepared, mut used, mut notes) = (Vec::new(), Vec::new(), Vec::new());
    for flight in flights {
        let ready = Prepared::new(flight, slowest)?;
        if ready.windows.is_empty() {
            notes.push(format!("{}: no stretch in the air long enough; left out", flight.name));
            continue;
        }
        if !ready.has_force() {
            notes.push(format!(
                "{}: no accelerometers, so drag, lift and side force are not compared, and effects on \
                 them alone are not seen",
                flight.name
            ));
        }
        prepared.push(ready);
        used.push(flight);
    }
    let sensors = used.iter().zip(&prepared).map(|(f, p)| sensors::widths(f, p.dt)).collect();
    let prior = model.coefficients().iter().map(|c| (c.value, c.width())).collect();
    let path = used.iter().zip(&prepared).map(|(f, p)| shared::path_error(f, p.dt)).collect();
    let (seed, per_flight) = (options.seed, options.per_flight);
    let problem = Problem { flights: prepared, prior, path, sensors, per_flight, seed };
    Ok((problem, used, notes))
}

/// The verdict on what the search found: an effect, something unexplained, or an adequate model.
pub fn verdict(found: &Found) -> Verdict {
    let significant =
        found.remainder.total > found.remainder.total_threshold && found.learnable() > WORTH_SAYING;
    if found.selected.iter().any(|s| s.refused.is_empty()) {
        Verdict::Effect
    } else if found.selected.iter().any(|s| !s.slight && s.trace.is_none())
        || (found.leaves_something() && (significant || found.has_shape()))
    {
        Verdict::Unexplained
    } else {
        Verdict::Adequate
    }
}

/// Ids of the candidates that a model lacks and that can be searched for.
pub fn searched(model: &GreyBox, without: &[String]) -> Vec<&'static str> {
    catalogue::candidates(model, &[], without).iter().map(|e| e.about.id).collect()
}
