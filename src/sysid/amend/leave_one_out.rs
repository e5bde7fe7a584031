//! Selection of a model's structure by leave-one-out cross-validation: each flight is predicted by a fit to all other flights.
//!
//! A structure states which coefficients are fitted and which effects (physical contributions to forces and moments) are added.
//! The error of a flight is the NRMSE of free runs (open-loop simulations from measured states).

mod fits;
mod set;

use rayon::prelude::*;
use serde::Serialize;

use super::amendment::{Added, joined};
use super::error::AmendError;
use super::flight::Flight;
use super::judge::{IMPROVED, judged_at};
use crate::diagnose::searched;
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::known::put_right;
use crate::per_flight::{PerFlight, SensorErrors};
use crate::progress::{Progress, report};
use fits::Fits;
use greylag_model::GreyBox;
use set::{Set, black_boxes, scores};

/// Smallest number of flights for leave-one-out cross-validation.
pub const LEAST_FLIGHTS: usize = 3;
/// Smallest number of flights for which structures are screened. With three, the best of forty structures is best by chance: on a real
/// flight in three parts the error of the chosen one was 2.5 times that of the best forecast.
const LEAST_FOR_SCREENING: usize = 6;
/// Largest number of screened structures that are then fitted.
const FITTED_AFTER_SCREENING: usize = 3;
/// Factors of the prior standard deviations that [`alternatives`] have.
const WIDER: [f64; 2] = [3.0, 10.0];

/// A structure to be compared.
#[derive(Clone, Debug)]
pub struct Structure {
    /// Name of the structure, in the words of the command line.
    pub name: String,
    /// The fitted part of the structure.
    pub fitted: Fitted,
    /// How the fit is made.
    pub effort: Effort,
}

/// How the fits of a structure are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// To convergence.
    Complete,
    /// By two Gauss–Newton steps from the fit of the model's coefficients alone, which must be among the structures. To convergence
    /// only if the structure is then one of the three best, and within one standard error of the best complete fit. Structures with
    /// trims or axes of each flight, from scratch or with a linear residual are always fitted to convergence.
    Screened,
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
    /// The model's coefficients, with their prior standard deviations multiplied by this factor.
    Widened(f64),
    /// The model's coefficients, and then a linear residual of the fitted model (see [`linear_residual`](super::linear_residual)).
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
    /// Whether `errors` are those of [`Effort::Screened`], without a fit to convergence. Such a structure is not chosen.
    pub screened: bool,
    /// For each of `flights` the model that was fitted to all other flights; `None` if the fit failed. Empty for a baseline and a
    /// screened structure.
    #[serde(skip)]
    pub models: Vec<Option<GreyBox>>,
    /// Mean of `errors`; infinite if one of them is NaN.
    pub mean: f64,
    /// Standard error of `mean`, from the scatter of `errors`.
    pub standard_error: f64,
    /// The same model together with the held and the mean state; `None` for a baseline and a screened structure.
    pub combined: Option<Combined>,
    /// Standard error of the mean difference from the best structure's errors, flight by flight. NaN for a baseline.
    pub beside_best: f64,
    /// Whether the structure is chosen: the simplest structure within one standard error of the best.
    pub chosen: bool,
}

/// Structures beside a fit of the coefficients of `model`, to be screened: wider priors, with names by `widened`, and each effect of the
/// catalogue that `model` lacks and that is not among `others`, with names by `with`.
///
/// Effects of which a diagnosis knows no starting values are left out.
pub fn alternatives(
    model: &GreyBox,
    others: &[Added],
    widened: impl Fn(f64) -> String,
    with: impl Fn(&str) -> String,
) -> Vec<Structure> {
    let effort = Effort::Screened;
    let wider =
        |factor| Structure { name: widened(factor), fitted: Fitted::Widened(factor), effort };
    let new = searched(model, &[]).into_iter().filter(|id| others.iter().all(|o| o.id != *id));
    let added = new.map(|id| Added { id: id.into(), start: None });
    let possible = added.filter(|added| joined(&mut model.clone(), added).is_ok());
    let beside = possible.map(|added| {
        let per_flight = PerFlight { sensors: SensorErrors::Dropped, ..PerFlight::default() };
        let name = with(&added.id);
        let fitted = Fitted::Coefficients { effects: vec![added], per_flight };
        Structure { name, fitted, effort }
    });
    WIDER.into_iter().map(wider).chain(beside).collect()
}

/// Leaves out each of `flights` in turn and computes the error of each of `structures` of `model` on this flight. Baselines
/// (forecasts without aerodynamics) follow in the result and are never chosen.
///
/// The fits without a flight start from one fit to all flights (`output_error::without_each`), those from scratch do not.
///
/// The chosen structure has the fewest free coefficients among all whose mean error exceeds that of the best structure by no
/// more than one standard error of the difference, flight by flight, or by 1 % (the rule of Breiman et al., Classification and
/// Regression Trees, 1984, section 3.4.3, with paired differences). Structures that were only screened ([`Effort::Screened`]) are not
/// among them. With fewer than six flights none is screened.
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
    let enough = judges.len() >= LEAST_FOR_SCREENING;
    let compared = structures.iter().filter(|structure| enough || !structure.is_screened());
    let compared: Vec<Structure> = compared.cloned().collect();
    let mut all = of_structures(&mut Fits::of(model, &set), &compared, progress)?;
    choose(&mut all);
    all.extend(black_boxes(model, &set));
    all.iter_mut().for_each(|s| s.flights = names.clone());
    Ok(all)
}

/// The errors of all `structures`, in their order. Those to be screened follow after all others.
fn of_structures(
    fits: &mut Fits,
    structures: &[Structure],
    progress: &Progress,
) -> Result<Vec<Scored>, AmendError> {
    let (mut done, count) = (0, structures.len() + FITTED_AFTER_SCREENING);
    let mut next = |doing: String| {
        done += 1;
        report(progress, &doing, (done - 1) as f64 / count as f64)
    };
    let mut all: Vec<Option<Scored>> = vec![None; structures.len()];
    let (quick, others): (Vec<_>, Vec<_>) =
        structures.iter().enumerate().partition(|(_, structure)| structure.is_screened());
    for (k, structure) in others {
        next(format!("{}: leaving out one flight after the other", structure.name))?;
        all[k] = Some(fits.complete(structure)?);
    }
    for (k, structure) in quick {
        next(format!("{}: screened", structure.name))?;
        all[k] = Some(fits.screened(structure)?);
    }
    let mut all: Vec<Scored> = all.into_iter().flatten().collect();
    for k in promising(&all) {
        next(format!("{}: leaving out one flight after the other", structures[k].name))?;
        all[k] = fits.complete(&structures[k])?;
    }
    // if no fit succeeded, the model as given would be chosen without a comparison
    match fits.failure() {
        Some(why) => Err(why),
        None => Ok(all),
    }
}

/// Indices of the screened structures that are worth a complete fit: the best ones within one standard error, or 1 %, of the best
/// complete fit.
fn promising(all: &[Scored]) -> Vec<usize> {
    let complete = all.iter().filter(|s| !s.screened);
    let best = complete.min_by(|a, b| a.mean.total_cmp(&b.mean)).filter(|b| b.mean.is_finite());
    let Some(best) = best else { return Vec::new() };
    let within = |k: &usize| all[*k].screened && all[*k].beside(best).0;
    let mut places: Vec<usize> = (0..all.len()).filter(within).collect();
    places.sort_by(|a, b| all[*a].mean.total_cmp(&all[*b].mean));
    places.truncate(FITTED_AFTER_SCREENING);
    places
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
        screened: false,
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

impl Scored {
    /// Whether the mean error exceeds that of `best` by no more than one standard error of the difference, or by 1 %; and this
    /// standard error.
    fn beside(&self, best: &Scored) -> (bool, f64) {
        let more: Vec<f64> = self.errors.iter().zip(&best.errors).map(|(a, b)| a - b).collect();
        let [difference, error] = mean_with_error(&more);
        (difference <= error.max(IMPROVED * best.mean), error)
    }
}

/// Marks the structure with the fewest free coefficients whose mean error exceeds the best by no more than one standard error
/// of the difference, or by 1 %. Structures that were only screened do not take part.
fn choose(all: &mut [Scored]) {
    let complete = all.iter().filter(|s| !s.screened);
    let best = complete.min_by(|a, b| a.mean.total_cmp(&b.mean)).cloned();
    let Some(best) = best.filter(|b| b.mean.is_finite()) else { return };
    let mut simplest: Option<(usize, usize)> = None;
    for (k, s) in all.iter_mut().enumerate() {
        let (within, error) = s.beside(&best);
        s.beside_best = error;
        if within && !s.screened && simplest.is_none_or(|(_, free)| s.free < free) {
            simplest = Some((k, s.free));
        }
    }
    if let Some((k, _)) = simplest {
        all[k].chosen = true;
    }
}

#[cfg(test)]
mod tests;
