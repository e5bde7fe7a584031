//! The diagnosis of a model finds the effects (groups of model terms) of a catalogue that the model lacks according to recorded
//! flights. This module prepares the flights, runs the search and assembles the result.
//!
//! An effect that the search has found is refused if a check fails, and otherwise asserted. A channel is a force or a moment.

use crate::compare::{self, ChannelId, unpredicted};
use crate::diagnose::answer::advice;
use crate::diagnose::answer::decoys;
use crate::diagnose::answer::impossible::impossible;
use crate::diagnose::answer::measurement;
use crate::diagnose::answer::per_flight;
use crate::diagnose::answer::probability;
use crate::diagnose::answer::ranking;
use crate::diagnose::answer::result::{
    ChannelLeft, Decoy, Diagnosis, Nulls, Settings, Tuned, Verdict,
};
use crate::diagnose::answer::rival::against_axes;
use crate::diagnose::answer::sentences::{self, Content, WhyUnknown};
use crate::diagnose::answer::shares;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::options::{Detail, Options};
use crate::diagnose::regression::catalogue;
use crate::diagnose::regression::local::CHANNELS;
use crate::diagnose::regression::sensors;
use crate::diagnose::regression::shared;
use crate::diagnose::search::excitation;
use crate::diagnose::search::round::Problem;
use crate::diagnose::search::stepwise::{Found, search};
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::known::{Corrected, corrected};
use crate::progress::{Progress, report};
use crate::rudder;
use crate::weak_form::prepared::Prepared;
use crate::weak_form::windows::{self, Series};
use greylag_model::{GreyBox, RUDDER};
use greylag_physics as physics;

/// If a flexible model (a regression without physics) could remove more than this fraction of the residual beyond noise, this is
/// evidence that the model lacks something. Errors of the flight-path reconstruction stay below it.
const WORTH_SAYING: f64 = 0.1;
/// The same limit if an effect was refused for another reason than its small size.
const REFUSED: f64 = 0.01;
/// Reason for which all effects are refused if an estimate is physically impossible.
const CANNOT_BE: &str =
    "a figure of these flights cannot be, so that nothing is said about forces and moments";
/// Reason for which an effect is refused if its coefficients may be zero when all effects are estimated together.
const MAY_BE_ZERO: &str = "its 95 % interval holds zero once all effects have settled";

/// Determines which effects of the catalogue `model` lacks according to `flights`.
///
/// The deflections of the reconstructed flights must be the recorded ones. `progress` is called at each stage and may cancel.
///
/// # Errors
/// There is too little flight or excitation, the id of an effect is unknown, the sampling interval of a flight is not
/// usable, the model cannot be evaluated over the flights, or `progress` cancelled.
pub fn diagnose(
    model: &GreyBox,
    flights: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Diagnosis, DiagnoseError> {
    if model.known.is_empty() {
        return of_unknown(model, flights, options, progress);
    }
    let Corrected { flights, per_flight, notes } =
        corrected(&model.known, flights, options.per_flight);
    let mut bare = model.clone();
    bare.known = Default::default();
    let options = Options { per_flight, ..options.clone() };
    let mut diagnosis = of_unknown(&bare, &flights, &options, progress)?;
    diagnosis.notes.splice(0..0, notes);
    Ok(diagnosis)
}

/// The diagnosis without the constants of installation and flights (sensor errors, trims) that the model file may contain.
fn of_unknown(
    model: &GreyBox,
    flights: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Diagnosis, DiagnoseError> {
    known(&options.without)?;
    known(&options.with)?;
    let (problem, used, mut notes) = problem(model, flights, options)?;
    notes.extend(predicted(model, &loads(model, &problem.flights))?);
    notes.extend(excitation::check(&problem.flights)?);
    let found = search(&problem, model, options, progress)?;
    let mut found = against_axes(problem, model, options, progress, found)?;
    report(progress, "what is left", 0.95)?;
    let rudder = rudder::unmodelled(flights, model);
    if let Some(motion) = rudder {
        found.refuse_in(&rudder::CHANNELS, RUDDER, &rudder::reason(motion));
    }
    let Judged { abstained, faultless, tuned, doubtful } = judge(&mut found, model, &used, options);
    let channels = shares::channels(&found, &abstained);
    let effects = shares::placed(ranking::candidates(&found, options), &channels);
    let mut measurement = measurement::measurement(&used);
    measurement.extend(per_flight::angles(found.round()));
    let trims = per_flight::trims(found.round());
    let (verdict, why_unknown) = spoken(&found, &doubtful, &channels, faultless);
    let explanations = probability::explanations(verdict, &effects, found.learnable());
    notes.extend(sentences::notes(&found, model, verdict, options));
    let findings = sentences::sentences(&Content {
        found: &found,
        verdict,
        why_unknown,
        doubtful: &doubtful,
        effects: &effects,
        explanations: &explanations,
        channels: &channels,
        measurement: &measurement,
        trims: &trims,
    });
    Ok(Diagnosis {
        schema: "greylag.diagnosis/1",
        version: env!("CARGO_PKG_VERSION"),
        model: model.name.clone(),
        verdict,
        sentences: rudder.map(rudder::warning).into_iter().chain(findings).collect(),
        doubtful,
        advice: advice::advice(&found, verdict, &effects, &channels),
        effects,
        explanations,
        channels,
        measurement,
        trims,
        tuned,
        nulls: Nulls { count: options.nulls, best: found.nulls.clone(), level: options.level },
        decoys: decoys_of(&found, options),
        learnable_remainder: found.learnable(),
        notes,
        settings: settings(options),
    })
}

/// The placebo regressors; none unless all details are wanted.
fn decoys_of(found: &Found, options: &Options) -> Vec<Decoy> {
    match options.detail {
        Detail::Full => decoys::decoys(found, options.seed),
        Detail::Lean => Vec::new(),
    }
}

/// The forces and moments of `flights`, measured and predicted by `model`.
fn loads(model: &GreyBox, flights: &[Prepared]) -> Vec<Vec<Series>> {
    let is_load = |s: &Series| ChannelId::ALL[..CHANNELS].contains(&s.channel);
    let of = |flight: &Prepared| -> Vec<Series> {
        windows::channels(model, flight).into_iter().filter(is_load).collect()
    };
    flights.iter().map(of).collect()
}

/// Returns a note on the windows (short stretches of flight) in which `model` predicts no finite number; `None` if there are
/// none.
///
/// # Errors
/// In all windows of a measured channel, the model predicts no finite number. Such a channel would otherwise count as
/// explained.
fn predicted(model: &GreyBox, series: &[Vec<Series>]) -> Result<Option<String>, DiagnoseError> {
    let lost = |channel: &ChannelId| {
        let own = series.iter().flatten().filter(|s| s.channel == *channel);
        let pairs = own.flat_map(|s| s.measured.iter().zip(&s.predicted));
        let mut measured = pairs.filter(|(measured, _)| measured.is_finite()).peekable();
        measured.peek().is_some() && measured.all(|(_, predicted)| !predicted.is_finite())
    };
    match ChannelId::ALL.iter().any(lost) {
        true => Err(DiagnoseError::Unusable { model: model.name.clone() }),
        false => Ok(unpredicted(series)),
    }
}

fn settings(options: &Options) -> Settings {
    Settings {
        seed: options.seed,
        nulls: options.nulls,
        bootstraps: options.bootstraps,
        without: options.without.clone(),
        per_flight: options.per_flight,
    }
}

/// Results of the checks that follow the search.
struct Judged {
    abstained: [Option<String>; 6],
    /// Whether `compare` finds no channel in which the given model certainly errs.
    faultless: bool,
    tuned: Vec<Tuned>,
    doubtful: Vec<String>,
}

/// Refuses effects if the flights cannot assess the model in any of their channels, and effects whose coefficients may be zero.
/// Refuses all effects if an estimate is physically impossible.
fn judge(
    found: &mut Found,
    model: &GreyBox,
    flights: &[&Reconstruction],
    options: &Options,
) -> Judged {
    let (abstained, faultless) = compared(model, flights, options.seed);
    found.refuse_where_abstained(&abstained);
    let void = ranking::void(found, options);
    found.refuse(&void, MAY_BE_ZERO);
    let tuned = shares::tuned(found, model);
    let doubtful = impossible(flights, &tuned);
    if !doubtful.is_empty() {
        found.refuse_all(CANNOT_BE);
    }
    Judged { abstained, faultless, tuned, doubtful }
}

/// Returns the verdict. If it is [`Verdict::Unknown`] although no estimate is impossible, also returns the reason.
///
/// An impossible estimate turns any verdict into `Unknown`. The verdict `Unexplained` becomes `Unknown` in three more cases: no
/// channel can be assessed, the given model has no certain error, or a flexible model of the states removes little of the
/// residual. In the last case the residual is not a function of the states, as after timing errors or with filtered sensors.
fn spoken(
    found: &Found,
    doubtful: &[String],
    channels: &[ChannelLeft],
    faultless: bool,
) -> (Verdict, Option<WhyUnknown>) {
    let remainder = &found.remainder;
    let little = remainder.total > remainder.total_threshold && found.learnable() < WORTH_SAYING;
    let unknown = |why| (Verdict::Unknown, Some(why));
    match verdict(found) {
        _ if !doubtful.is_empty() => (Verdict::Unknown, None),
        Verdict::Unexplained if channels.iter().all(|c| c.abstained) => {
            unknown(WhyUnknown::SensorsMayAccount)
        }
        Verdict::Unexplained if faultless => unknown(WhyUnknown::GivenModelFaultless),
        Verdict::Unexplained if little => unknown(WhyUnknown::NotOfTheStates),
        verdict => (verdict, None),
    }
}

/// Returns two results of `compare`: for each channel, the reason why the model cannot be assessed in it; and whether the model
/// certainly errs in no channel.
fn compared(
    model: &GreyBox,
    flights: &[&Reconstruction],
    seed: u64,
) -> ([Option<String>; 6], bool) {
    let flights: Vec<Reconstruction> = flights.iter().map(|f| (*f).clone()).collect();
    let all = compare::abstentions(model, &flights, seed).unwrap_or_default();
    let abstained = std::array::from_fn(|k| {
        let own = all.iter().find(|a| a.channel == ChannelId::ALL[k]);
        own.and_then(|a| a.why).map(str::to_owned)
    });
    (abstained, !all.is_empty() && all.iter().all(|a| !a.sure_error))
}

/// Checks that every id belongs to an effect of the catalogue or of a loaded effect file.
pub fn known(ids: &[String]) -> Result<(), DiagnoseError> {
    match ids.iter().find(|id| physics::catalogue::describe(id).is_none()) {
        None => Ok(()),
        Some(id) => Err(DiagnoseError::UnknownEffect { id: id.clone() }),
    }
}

/// The problem of the search, the flights that it contains, and notes for the user.
pub type Intake<'a> = (Problem, Vec<&'a Reconstruction>, Vec<String>);

/// Resamples the flights to a multiple of the model's time step, and sets up the problem of the search with its priors. Flights
/// that cannot be used are left out with a note.
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

/// Returns the verdict on the result of the search: an effect, something unexplained, or an adequate model.
pub fn verdict(found: &Found) -> Verdict {
    let significant =
        found.remainder.total > found.remainder.total_threshold && found.learnable() > WORTH_SAYING;
    if found.selected.iter().any(|s| s.refused.is_empty()) {
        Verdict::Effect
    } else if (found.selected.iter().any(|s| !s.slight && s.trace.is_none())
        && (found.leaves_something() || found.learnable() > REFUSED))
        || (found.leaves_something() && (significant || found.has_shape()))
    {
        Verdict::Unexplained
    } else {
        Verdict::Adequate
    }
}

/// Ids of the effects for which a diagnosis of `model` searches. The effects `without` are left out.
pub fn searched(model: &GreyBox, without: &[String]) -> Vec<&'static str> {
    catalogue::candidates(model, &[], without).iter().map(|e| e.about.id).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn windows_without_a_prediction_are_noted_and_a_channel_without_any_is_refused() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        let model = GreyBox::load(&path).unwrap();
        let series = |channel, predicted: [f64; 2]| Series {
            channel,
            measured: vec![1.0, 2.0],
            predicted: predicted.to_vec(),
            noise_variance: 0.0,
        };
        let whole = series(ChannelId::Roll, [1.0, 2.0]);
        assert_eq!(predicted(&model, &[vec![whole.clone()]]).unwrap(), None);
        let part = vec![whole.clone(), series(ChannelId::Lift, [1.0, f64::NAN])];
        let note = predicted(&model, &[part]).unwrap().unwrap();
        assert!(note.ends_with("lift 1 of 2."), "{note}");
        let none = vec![whole, series(ChannelId::Lift, [f64::NAN; 2])];
        assert!(matches!(predicted(&model, &[none]), Err(DiagnoseError::Unusable { .. })));
    }
}
