//! Selection of a model's structure by leave-one-out cross-validation: each flight is predicted by a fit to all other flights.
//!
//! A structure states which coefficients are fitted and which effects (physical contributions to forces and moments) are added.
//! The error of a flight is the NRMSE of free runs (open-loop simulations from measured states).

use rayon::prelude::*;
use serde::Serialize;

use super::amendment::{Added, joined};
use super::error::AmendError;
use super::flight::Flight;
use super::judge::{IMPROVED, Judge, judged, judged_at};
use super::linear_residual;
use super::output_error::{self, FitOptions};
use super::parameters;
use crate::compare::combination::{EVERY_S, Forecasts, choose as choose_weights, mean_state};
use crate::compare::forecast;
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::known::put_right;
use crate::per_flight::{PerFlight, SensorErrors};
use crate::progress::{Progress, report};
use crate::weak_form::prepared::Prepared;
use greylag_model::GreyBox;

/// Smallest number of flights for leave-one-out cross-validation.
pub const LEAST_FLIGHTS: usize = 3;

/// A structure to be compared.
#[derive(Clone, Debug)]
pub struct Structure {
    /// Name of the structure, in the words of the command line.
    pub name: String,
    /// The fitted part of the structure.
    pub fitted: Fitted,
}

/// What is fitted in a structure.
#[derive(Clone, Debug)]
pub enum Fitted {
    /// No coefficient: the model as given.
    Nothing,
    /// The model's coefficients, together with added effects and constants of each flight.
    Coefficients {
        /// Effects that are added.
        effects: Vec<Added>,
        /// Constants estimated for each flight.
        per_flight: PerFlight,
    },
    /// The model's coefficients, and then a linear residual of the fitted model (see [`linear_residual`]).
    LinearResidual,
    /// All coefficients of the model, including those with the value zero. The physical bounds are their only prior.
    FromScratch,
}

/// Cross-validation result of a structure together with the held and the mean state: see [`crate::compare::combination`].
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Combined {
    /// Mean scaled error (dimensionless) over the flights, each with weights from the other flights.
    pub error: f64,
    /// Weight of the model, mean over the states, 0 to 1. A small weight says that the model is not to be trusted so far ahead.
    pub weight_of_model: f64,
}

/// Cross-validation result of a structure.
#[derive(Clone, Debug, Serialize)]
pub struct Scored {
    /// Description of the structure.
    pub structure: String,
    /// Number of free coefficients plus the number of constants of one flight.
    pub free: usize,
    /// The flights that are long enough to be predicted.
    pub flights: Vec<String>,
    /// Error of each of `flights` with the fit to all other flights; NaN if the fit failed.
    pub errors: Vec<f64>,
    /// For each of `flights` the model that was fitted to all other flights; `None` if the fit failed. Empty for a baseline.
    #[serde(skip)]
    pub models: Vec<Option<GreyBox>>,
    /// Mean of `errors`; infinite if one of them is NaN.
    pub mean: f64,
    /// Standard error of `mean`, from the scatter of `errors`.
    pub standard_error: f64,
    /// The same model together with the held and the mean state; `None` for a baseline.
    pub combined: Option<Combined>,
    /// Standard error of the mean difference from the best structure's errors, flight by flight. NaN for a baseline.
    pub beside_best: f64,
    /// Whether the structure is chosen: the simplest structure within one standard error of the best.
    pub chosen: bool,
}

/// Leaves out each of `flights` in turn and computes the error of each of `structures` of `model` on this flight. Baselines
/// (forecasts without aerodynamics) follow in the result and are never chosen.
///
/// The fits without a flight start from one fit to all flights (`output_error::without_each`), those from scratch do not.
///
/// The chosen structure has the fewest free coefficients among all whose mean error exceeds that of the best structure by no
/// more than one standard error of the difference, flight by flight, or by 1 % (the rule of Breiman et al., Classification and
/// Regression Trees, 1984, section 3.4.3, with paired differences).
///
/// # Errors
/// If fewer than [`LEAST_FLIGHTS`] flights are long enough for the shortest horizon, if the sampling interval of a flight is
/// not usable, if an effect cannot be added to the model, if every fit fails, or if `progress` cancels.
pub fn leave_one_out(
    model: &GreyBox,
    flights: &[Reconstruction],
    structures: &[Structure],
    horizons_s: &[f64],
    progress: &Progress,
) -> Result<Vec<Scored>, AmendError> {
    if flights.len() < LEAST_FLIGHTS {
        return Err(AmendError::TooFewFlights { flights: flights.len(), needed: LEAST_FLIGHTS });
    }
    let slowest = model.airframe.envelope.flying_from_mps();
    let ready = |all: &[Reconstruction]| {
        all.par_iter().map(|f| Flight::new(f, slowest)).collect::<Result<Vec<_>, _>>()
    };
    let right = ready(&put_right(&model.known, flights).0)?;
    let ready = ready(flights)?;
    // all structures are compared at the longest horizon that every predicted flight reaches
    let reached = |f: &Flight| judged_at(&scores(model, std::slice::from_ref(f), horizons_s));
    let reached: Vec<Option<f64>> = ready.iter().map(reached).collect();
    let at = reached.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    let judges: Vec<usize> = (0..ready.len()).filter(|k| reached[*k].is_some()).collect();
    if judges.len() < LEAST_FLIGHTS {
        return Err(AmendError::TooFewFlights { flights: judges.len(), needed: LEAST_FLIGHTS });
    }
    let names: Vec<String> = judges.iter().map(|k| flights[*k].name.clone()).collect();
    let set = Set { judged: &ready, fitted: &right, judges: &judges, at };
    let (mut all, mut failed, mut any_fit) = (Vec::new(), None, false);
    let mut tuned: Option<Models> = None;
    for (k, structure) in structures.iter().enumerate() {
        let doing = format!("{}: leaving out one flight after the other", structure.name);
        report(progress, &doing, k as f64 / structures.len() as f64)?;
        let fitted = &structure.fitted;
        let mut models = match (fitted, &tuned) {
            (Fitted::Nothing, _) => vec![Some(model.clone()); judges.len()],
            (Fitted::LinearResidual, Some(tuned)) => tuned.clone(),
            _ => fit(model, &set, fitted, &mut failed)?,
        };
        any_fit |= !matches!(fitted, Fitted::Nothing) && models.iter().any(Option::is_some);
        if fitted.tunes_only() {
            tuned = Some(models.clone());
        }
        if matches!(fitted, Fitted::LinearResidual) {
            models = set.with_residuals(&models);
        }
        let combined = set.combined(&models);
        let of = scored(structure, free(model, fitted)?, set.errors(&models));
        all.push(Scored { models, combined, ..of });
    }
    // if no fit succeeded, the model as given would be chosen without a comparison
    if let Some(why) = failed.filter(|_| !any_fit) {
        return Err(why);
    }
    choose(&mut all);
    all.extend(black_boxes(model, &set));
    all.iter_mut().for_each(|s| s.flights = names.clone());
    Ok(all)
}

impl Fitted {
    /// Whether only the model's coefficients are fitted, or a linear residual after them.
    fn tunes_only(&self) -> bool {
        match self {
            Fitted::LinearResidual => true,
            Fitted::Coefficients { effects, per_flight } => {
                effects.is_empty() && unjudged(per_flight) == unjudged(&PerFlight::default())
            }
            Fitted::Nothing | Fitted::FromScratch => false,
        }
    }
}

/// For each flight that is left out, the model that was fitted to all other flights; `None` if the fit failed.
type Models = Vec<Option<GreyBox>>;

/// The flights of a cross-validation.
struct Set<'a> {
    /// All flights as reconstructed, for the predictions.
    judged: &'a [Flight],
    /// The same flights, corrected for the sensor errors and misaligned axes that the model's file states, for the fits.
    fitted: &'a [Flight],
    /// Indices of the flights that are long enough to be predicted. The other flights are only used in fits.
    judges: &'a [usize],
    /// Horizon of the errors, s.
    at: f64,
}

/// Errors of the baseline forecasts: held state, straight flight, and a linear model fitted to the other flights.
fn black_boxes(model: &GreyBox, set: &Set) -> Vec<Scored> {
    let prepared: Vec<Prepared> = set.judged.iter().map(|f| f.prepared.clone()).collect();
    let names = ["hold the state", "fly straight on", "linear (ARX), fitted to the others"];
    let mut errors = vec![Vec::new(); names.len()];
    for &left in set.judges {
        let others = prepared.iter().enumerate().filter(|(k, _)| *k != left);
        let others: Vec<Prepared> = others.map(|(_, f)| f.clone()).collect();
        let one = std::slice::from_ref(&prepared[left]);
        let results = forecast::on_unseen(&others, one, model.scale(), &[set.at]);
        for (k, list) in errors.iter_mut().enumerate() {
            list.push(results.get(k).map_or(f64::NAN, |r| r.free_run[0].rmse_scaled));
        }
    }
    let of = |(name, errors): (&str, Vec<f64>)| {
        scored(&Structure { name: name.into(), fitted: Fitted::Nothing }, 0, errors)
    };
    names.into_iter().zip(errors).map(of).collect()
}

fn scores(
    model: &GreyBox,
    test: &[Flight],
    horizons_s: &[f64],
) -> Vec<crate::compare::HorizonScore> {
    Judge { test, horizons_s }.scores(model)
}

impl Set<'_> {
    /// Error of each predicted flight with the model that was fitted to all other flights; NaN without a model.
    fn errors(&self, models: &[Option<GreyBox>]) -> Vec<f64> {
        let one = |(left, model): (&usize, &Option<GreyBox>)| {
            let Some(model) = model else { return f64::NAN };
            let test = std::slice::from_ref(&self.judged[*left]);
            judged(&scores(model, test, &[self.at])).unwrap_or(f64::NAN)
        };
        self.judges.par_iter().zip(models).map(one).collect()
    }

    /// `models`, each with its linear residual.
    fn with_residuals(&self, models: &[Option<GreyBox>]) -> Models {
        let one = |(left, model): (&usize, &Option<GreyBox>)| {
            Some(corrected(model.clone()?, self, *left))
        };
        self.judges.par_iter().zip(models).map(one).collect()
    }

    /// What `models` reach together with the held and the mean state. `None` if fewer than two flights have a model.
    fn combined(&self, models: &[Option<GreyBox>]) -> Option<Combined> {
        let one = |(left, model): (&usize, &Option<GreyBox>)| {
            let others = self.judged.iter().enumerate().filter(|(k, _)| k != left);
            let others: Vec<&Prepared> = others.map(|(_, f)| &f.prepared).collect();
            let mean_state = mean_state(others);
            let flight = &self.judged[*left].prepared;
            Some(Forecasts::of_model(
                model.as_ref()?,
                flight,
                &[self.at],
                EVERY_S,
                None,
                mean_state,
            ))
        };
        let parts: Vec<Forecasts> = self.judges.par_iter().zip(models).filter_map(one).collect();
        let chosen = choose_weights(&parts)?;
        let weight_of_model = chosen.combination.of_model()[0];
        Some(Combined { error: chosen.error, weight_of_model })
    }
}

/// Fits the structure `fitted` without each of the predicted flights. The first error of a fit is put in `failed`.
fn fit(
    model: &GreyBox,
    set: &Set,
    fitted: &Fitted,
    failed: &mut Option<AmendError>,
) -> Result<Models, AmendError> {
    let anew = matches!(fitted, Fitted::Coefficients { per_flight, .. } if per_flight.angles() > 0);
    let flights = if anew { set.judged } else { set.fitted };
    let (start, options) = match fitted {
        Fitted::Nothing | Fitted::LinearResidual => (
            model.clone(),
            FitOptions { per_flight: unjudged(&PerFlight::default()), ..FitOptions::default() },
        ),
        Fitted::FromScratch => {
            let per_flight = PerFlight { sensors: SensorErrors::Dropped, ..PerFlight::default() };
            (parameters::from_scratch(model), FitOptions { per_flight, ..FitOptions::default() })
        }
        Fitted::Coefficients { effects, per_flight } => {
            let added = effects.iter().map(|a| a.id.clone()).collect();
            let per_flight = unjudged(per_flight);
            let options = FitOptions { added, per_flight, ..FitOptions::default() };
            (with(model, effects)?, options)
        }
    };
    let without = match fitted {
        Fitted::FromScratch => output_error::without_each_anew,
        _ => output_error::without_each,
    };
    let fits = without(&start, flights, &options, set.judges);
    let mut models = Vec::with_capacity(fits.len());
    for fit in fits {
        match fit {
            Ok(fit) => models.push(Some(fit.model)),
            Err(why) => {
                *failed = failed.take().or(Some(why));
                models.push(None);
            }
        }
    }
    Ok(models)
}

/// `per_flight` without common sensor errors, unless they are kept in any case: no other flight is left to judge them.
fn unjudged(per_flight: &PerFlight) -> PerFlight {
    let sensors = match per_flight.sensors {
        SensorErrors::Kept => SensorErrors::Kept,
        SensorErrors::Judged | SensorErrors::Dropped => SensorErrors::Dropped,
    };
    PerFlight { sensors, ..*per_flight }
}

/// `model` with its linear residual over all flights except the one with the index `left`; `model` if no residual helps.
fn corrected(model: GreyBox, set: &Set, left: usize) -> GreyBox {
    let others = set.judged.iter().enumerate().filter(|(k, _)| *k != left);
    let others: Vec<Prepared> = others.map(|(_, f)| f.prepared.clone()).collect();
    linear_residual::fit(&model, &others, &[set.at]).map_or(model, |found| found.model)
}

fn with(model: &GreyBox, effects: &[Added]) -> Result<GreyBox, AmendError> {
    let mut with = model.clone();
    effects.iter().try_for_each(|added| joined(&mut with, added))?;
    Ok(with)
}

/// Number of free coefficients of a structure, plus the number of constants of one flight.
fn free(model: &GreyBox, fitted: &Fitted) -> Result<usize, AmendError> {
    Ok(match fitted {
        Fitted::Nothing => 0,
        Fitted::LinearResidual => parameters::free(model, &[]).len() + linear_residual::FREE,
        Fitted::FromScratch => parameters::free(&parameters::from_scratch(model), &[]).len(),
        Fitted::Coefficients { effects, per_flight } => {
            let ids: Vec<&str> = effects.iter().map(|a| a.id.as_str()).collect();
            parameters::free(&with(model, effects)?, &ids).len() + per_flight.constants().len()
        }
    })
}

fn scored(structure: &Structure, free: usize, errors: Vec<f64>) -> Scored {
    let [mean, standard_error] = mean_with_error(&errors);
    let mean = if mean.is_nan() { f64::INFINITY } else { mean };
    let structure = structure.name.clone();
    Scored {
        structure,
        free,
        flights: Vec::new(),
        errors,
        models: Vec::new(),
        mean,
        standard_error,
        combined: None,
        beside_best: f64::NAN,
        chosen: false,
    }
}

/// Mean and standard error of the mean.
pub(super) fn mean_with_error(x: &[f64]) -> [f64; 2] {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    [mean, (variance / n).sqrt()]
}

/// Marks the structure with the fewest free coefficients whose mean error exceeds the best by no more than one standard error
/// of the difference, or by 1 %.
fn choose(all: &mut [Scored]) {
    let best = all.iter().min_by(|a, b| a.mean.total_cmp(&b.mean)).cloned();
    let Some(best) = best.filter(|b| b.mean.is_finite()) else { return };
    let mut simplest: Option<(usize, usize)> = None;
    for (k, s) in all.iter_mut().enumerate() {
        let more: Vec<f64> = s.errors.iter().zip(&best.errors).map(|(a, b)| a - b).collect();
        let [difference, error] = mean_with_error(&more);
        s.beside_best = error;
        let within = difference <= error.max(IMPROVED * best.mean);
        if within && simplest.is_none_or(|(_, free)| s.free < free) {
            simplest = Some((k, s.free));
        }
    }
    if let Some((k, _)) = simplest {
        all[k].chosen = true;
    }
}

#[cfg(test)]
mod tests;
