//! Amends a model with flights. First its coefficients are re-estimated ("tuned"). Then effects are added that improve the
//! prediction of held-out flights, which are not used for the fit.
//!
//! An effect is a group of model terms with its coefficients, from the catalogue (the effects that the program knows) or from an
//! effect file. A free run is an open-loop simulation of the model along a recorded flight. Its horizon is its duration.

mod installation;
mod selection;

use std::sync::OnceLock;
use std::sync::atomic::AtomicUsize;

use super::error::AmendError;
use super::flight::Flight;
use super::judge::{self, JUDGED_AT_S, Judge};
use super::output_error::{Fit, FitOptions};
use super::result::{Amendment, Settings};
use super::{answer, bounds, parameters, story};
use crate::compare::{Answer, HorizonScore, forecast};
use crate::diagnose::Candidate;
use crate::flight_path::reconstruction::{Reconstruction, Segment};
use crate::per_flight::PerFlight;
use crate::per_flight::known::{Corrected, corrected};
use crate::progress::Progress;
use crate::rudder;
use greylag_model::GreyBox;
use greylag_physics::catalogue;
use greylag_physics::effects::{Coefficient, Description, Kind};
use selection::{Ask, Selection};

/// An effect to add, with optional starting values.
#[derive(Clone, Debug, PartialEq)]
pub struct Added {
    /// Identifier of the effect in the catalogue or in an effect file.
    pub id: String,
    /// Starting values of the effect's coefficients for the fit; `None` for the default starting values.
    pub start: Option<Vec<f64>>,
}

impl Added {
    /// The effect `candidate` of a diagnosis. The starting values are the diagnosis's estimates.
    pub fn of(candidate: &Candidate) -> Added {
        let of = |name: &str| candidate.parameters.iter().find(|p| p.name == name);
        Added::near(&candidate.id, |name| of(name).map(|p| p.value))
    }

    /// The effect `id`. The function `value` returns the starting value of the coefficient with a given name. If it returns
    /// `None` for any coefficient, the effect has no starting values.
    pub fn near(id: &str, value: impl Fn(&str) -> Option<f64>) -> Added {
        let coefficients = catalogue::describe(id).map(|about| about.coefficients);
        let start = coefficients.and_then(|all| all.iter().map(|c| value(c.name)).collect());
        Added { id: id.into(), start }
    }
}

/// What happens to an effect that fails one of these checks:
/// - A held-out flight is long enough for a free run, and the effect reduces the error of the free runs by more than 1 %.
/// - The fit with the effect converges. This check is waived if the error falls below half of the error without the effect.
/// - No fitted coefficient of the effect is at a bound.
/// - At least one coefficient of the effect differs significantly from zero.
/// - The estimate from a single flight does not contradict the estimate from all flights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// The effect is left out of the model.
    Left,
    /// The effect is added nevertheless, if its fit gave estimates.
    Kept,
}

/// Prior knowledge of the model's coefficients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prior {
    /// Values and standard deviations in the model file.
    #[default]
    File,
    /// Only the physically possible range of each coefficient.
    Bounds,
}

/// Options of an amendment.
#[derive(Clone, Debug)]
pub struct Options {
    /// Effects to add, in this order; empty to fit only the model's coefficients.
    pub effects: Vec<Added>,
    /// Prior on the model's coefficients.
    pub prior: Prior,
    /// What happens to effects that fail a check.
    pub refused: Refused,
    /// Horizons of the free runs, s.
    pub horizons_s: Vec<f64>,
    /// Whether other conventions than those of the model are tried. A convention is the choice of integrator, force axes or air
    /// density.
    pub conventions: bool,
    /// Constants that are estimated for each flight in addition to its sensor errors: misalignment angles of the sensor axes, and
    /// trims (constants added to force and moment coefficients, and a relative change of the thrust).
    pub per_flight: PerFlight,
    /// The fit of the model without added effects to the same flights, from [`tune`](super::tune). If it is `None`, it is
    /// computed.
    pub tuned: Option<Fit>,
}

impl Options {
    /// Fits are compared at the longest horizon that does not exceed this value, s.
    pub const JUDGED_AT_S: f64 = JUDGED_AT_S;
}

impl Default for Options {
    fn default() -> Self {
        let horizons_s = vec![1.0, 2.0, JUDGED_AT_S, 10.0];
        Options {
            effects: Vec::new(),
            prior: Prior::File,
            refused: Refused::Left,
            horizons_s,
            conventions: false,
            per_flight: PerFlight::default(),
            tuned: None,
        }
    }
}

/// Result of an amendment: its report, and the tuned and the amended model.
#[derive(Clone, Debug)]
pub struct Amended {
    /// The report, as written to `amend.json`.
    pub amendment: Amendment,
    /// The model with the accepted effects and all coefficients fitted.
    pub model: GreyBox,
    /// The model with its coefficients fitted and no effect added.
    pub tuned: GreyBox,
}

impl Amended {
    /// The coefficients that are zero because an added effect replaces their model term. Returns the name of each coefficient and
    /// the identifier of that effect.
    pub fn dropped(&self) -> Vec<(String, &'static str)> {
        dropped(&self.tuned, &self.model)
    }
}

/// The coefficients whose model term is replaced by an effect in `after` but by none in `before`. Returns the name of each
/// coefficient and the identifier of the effect.
fn dropped(before: &GreyBox, after: &GreyBox) -> Vec<(String, &'static str)> {
    let still = |name: &str| before.replaced(name).is_none();
    let named = before.coefficients().iter().filter(|c| still(&c.name));
    named.filter_map(|c| Some((c.name.clone(), after.replaced(&c.name)?))).collect()
}

/// Fits `model` with the effects of `options` to `flights`. Free runs along the flights `held_out` decide which effects are
/// accepted.
///
/// `progress` receives the stages and may cancel.
///
/// # Errors
/// If an effect cannot be added to the model, a flight's sampling interval is not usable, the flights do not allow a fit (see
/// `AmendError`), or `progress` cancels.
pub fn amend(
    model: &GreyBox,
    flights: &[Reconstruction],
    held_out: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Amended, AmendError> {
    for added in &options.effects {
        joined(&mut model.clone(), added)?;
    }
    let seen = answer::seen(flights, held_out);
    let Corrected { flights, per_flight, notes } =
        corrected(&model.known, flights, options.per_flight);
    let options = Options { per_flight, ..options.clone() };
    let mut amended = of_right(model, &flights, held_out, &options, progress)?;
    let forecasts = forecast::unfitted(model, held_out, &options.horizons_s)?;
    let answer = answer::answer(&amended.amendment, seen, &forecasts);
    let answer = if options.prior == Prior::Bounds { answer.from_scratch() } else { answer };
    let shares = answer::compared([model, &amended.tuned, &amended.model], held_out);
    amended.amendment.answer = match shares {
        Some(shares) => answer.acting(&shares),
        None => answer,
    };
    amended.amendment.notes.extend(notes);
    Ok(amended)
}

/// Amends `model` from `flights`. They are already corrected for the sensor errors and misalignment that the model's file
/// states. The `answer` of the result is empty.
fn of_right(
    model: &GreyBox,
    flights: &[Reconstruction],
    held_out: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Amended, AmendError> {
    let slowest = model.airframe.envelope.flying_from_mps();
    let ready = |all: &[Reconstruction]| {
        all.iter().map(|f| Flight::new(f, slowest)).collect::<Result<Vec<_>, _>>()
    };
    let (train, test) = (ready(flights)?, ready(held_out)?);
    let judge = Judge { test: &test, horizons_s: &options.horizons_s };
    let (begun, sensors) = (AtomicUsize::new(0), OnceLock::new());
    let ask = Ask { options, train: &train, judge: &judge, progress, begun, sensors };
    let (as_given, given) = (model, judge.scores(model));
    let scratch = (options.prior == Prior::Bounds).then(|| parameters::from_scratch(model));
    let model = scratch.as_ref().unwrap_or(model);
    let best = ask.selected(model)?;
    let (tuned, before) = best.tuned.clone();
    let (best, conventions) = match options.conventions {
        true => ask.with_conventions(model, best)?,
        false => (best, Vec::new()),
    };
    let Selection { fit, after, effects, .. } = best;
    let (fit, after, note) = match options.per_flight.angles() {
        0 => (fit, after, None),
        _ => installation::aligned(fit, after, &judge),
    };
    let mut notes = notes(model, &tuned.model, &fit);
    notes.extend(story::apart(&options.per_flight).into_iter().chain(note));
    notes.extend(ask.sensors.get().and_then(|decided| decided.note.clone()));
    let mut amendment = Amendment {
        schema: "greylag.amend/1",
        version: env!("CARGO_PKG_VERSION"),
        model: model.name.clone(),
        answer: Answer::nothing(),
        sentences: Vec::new(),
        effects,
        conventions,
        parameters: fit.parameters.clone(),
        tuned: tuned.parameters.clone(),
        flights: fit.flights.clone(),
        held_out: held_out.iter().map(|f| f.name.clone()).collect(),
        decrease: compared_at(options.prior, &given)
            .and_then(|s| judge.decrease(s, as_given, &fit.model)),
        given,
        before,
        after,
        notes,
        settings: settings(options),
    };
    let rudder = rudder::unmodelled(flights, model).or(rudder::unmodelled(held_out, model));
    amendment.sentences = rudder.map(rudder::warning).into_iter().collect();
    amendment.sentences.extend(story::sentences(&amendment));
    Ok(Amended { amendment, model: fit.model, tuned: tuned.model })
}

/// Settings of an amendment with `options`, for its report.
fn settings(options: &Options) -> Settings {
    Settings {
        lengths_s: FitOptions::default().lengths_s,
        horizons_s: options.horizons_s.clone(),
        judged_at_s: JUDGED_AT_S,
        per_flight: options.per_flight,
    }
}

/// Horizon at which the free-run errors of the amended model are compared with those of the given model, s. `given` holds the
/// errors of the given model over the held-out flights, one entry per horizon.
fn compared_at(prior: Prior, given: &[HorizonScore]) -> Option<f64> {
    match prior {
        Prior::File => judge::repeated_at(given),
        // without a prior the given coefficients are only guesses, so a horizon that a single run reaches is allowed
        Prior::Bounds => judge::judged_at(given),
    }
}

/// Adds the effect `added` to `model` at its starting values.
pub(super) fn joined(model: &mut GreyBox, added: &Added) -> Result<(), AmendError> {
    let start = match (&added.start, parameters::describe(&added.id)) {
        (Some(start), _) => start.clone(),
        (None, Some((about, _))) => usual_start(&about),
        (None, None) => Vec::new(),
    };
    Ok(model.join_most(&added.id, &start)?)
}

/// Default starting values of an effect's coefficients. If the effect lists none, each value is zero, or the bound nearest to
/// zero.
fn usual_start(about: &Description) -> Vec<f64> {
    let starts = about.entry.map_or(&[][..], |e| e.starts);
    let nearest = |c: &Coefficient| 0.0_f64.clamp(c.bounds.0, c.bounds.1);
    // an effect from an effect file starts at the first entry of its list, an effect of the catalogue at the middle entry
    let own = Kind::from_id(about.id).is_some_and(|kind| kind.written().is_some());
    let listed = starts.get(if own { 0 } else { starts.len() / 2 }).map(|s| s.to_vec());
    listed.unwrap_or_else(|| about.coefficients.iter().map(nearest).collect())
}

/// Notes on an amendment of `model`: on the fit, on coefficients that are not fitted, on contradictions between flights, on
/// estimates at their bounds, and on estimates that contradict their priors.
fn notes(model: &GreyBox, tuned: &GreyBox, fit: &Fit) -> Vec<String> {
    let mut notes = fit.notes.clone();
    notes.extend(
        dropped(tuned, &fit.model)
            .iter()
            .map(|(name, by)| format!("{name} is zero: {by} stands in its place.")),
    );
    notes.extend(parameters::taken_over(&fit.model).map(|(of, by)| {
        format!("The shape constants of {of} are held as fitted without {by}, which can represent any change of them.")
    }));
    let held = parameters::held_at_zero(model);
    if !held.is_empty() {
        notes.push(format!(
            "Held at zero, for their file states no standard deviation (sd): {}. --from-scratch frees them.",
            held.join(", ")
        ));
    }
    notes.extend(judge::contradictions(&fit.parameters));
    notes.extend(bounds::at_bounds(&fit.model, &fit.parameters));
    notes.extend(judge::against_prior(&fit.parameters));
    notes
}

/// Splits a flight into its first two thirds, for the fit, and its last third, which is held out.
pub fn split(flight: &Reconstruction) -> [Reconstruction; 2] {
    let total: usize = flight.segments.iter().map(|s| s.instants.len()).sum();
    let mut left = total * 2 / 3;
    let mut parts = [Vec::new(), Vec::new()];
    for Segment { instants } in &flight.segments {
        let (first, last) = instants.split_at(left.min(instants.len()));
        left -= first.len();
        for (part, piece) in parts.iter_mut().zip([first, last]) {
            if !piece.is_empty() {
                part.push(Segment { instants: piece.to_vec() });
            }
        }
    }
    parts.map(|segments| Reconstruction { segments, ..flight.clone() })
}
