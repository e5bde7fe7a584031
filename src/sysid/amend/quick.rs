//! Parts of the complete refit: an output-error fit without added effects, and a fast equation-error estimate with added effects
//! (physical contributions to forces and moments).

use rayon::prelude::*;

use super::amendment::{Added, Options, joined};
use super::equation_error;
use super::error::AmendError;
use super::flight::Flight;
use super::judge::Judge;
use super::output_error::{self, Fit, FitOptions};
use super::parameters;
use crate::compare::HorizonScore;
use crate::flight_path::reconstruction::Reconstruction;
use crate::progress::Progress;
use greylag_model::GreyBox;

/// A model estimated by equation error only, that is from forces and moments, without simulations.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The model with the estimated coefficients.
    pub model: GreyBox,
    /// Errors of the model in free runs (open-loop simulations) of the held-out flights, at the default horizons of [`Options`].
    pub after: Vec<HorizonScore>,
}

/// Fits the coefficients of `model` to `flights` by output error, without added effects. The result can be passed on in
/// [`Options::tuned`].
///
/// # Errors
/// If the flights do not allow a fit (see `AmendError`), or `progress` cancelled.
pub fn tune(
    model: &GreyBox,
    flights: &[Reconstruction],
    progress: &Progress,
) -> Result<Fit, AmendError> {
    output_error::fit(model, &ready(model, flights)?, &FitOptions::default(), progress)
}

/// Adds `effects` to `model`, estimates its coefficients by equation error over `flights`, and computes its errors in free runs
/// of `held_out`.
///
/// # Errors
/// If an effect cannot be added to the model, or the sampling interval of a flight is not usable.
pub fn estimate(
    model: &GreyBox,
    flights: &[Reconstruction],
    held_out: &[Reconstruction],
    effects: &[Added],
) -> Result<Estimate, AmendError> {
    let mut with = model.clone();
    for added in effects {
        joined(&mut with, added)?;
    }
    let ids: Vec<&str> = effects.iter().map(|a| a.id.as_str()).collect();
    let free = parameters::free(&with, &ids);
    let theta = equation_error::start(&with, &free, &ready(model, flights)?);
    let model = parameters::with(&with, &free, &theta);
    let test = ready(&model, held_out)?;
    let judge = Judge { test: &test, horizons_s: &Options::default().horizons_s };
    let after = judge.scores(&model);
    Ok(Estimate { model, after })
}

/// Prepares the flights for a fit.
fn ready(model: &GreyBox, flights: &[Reconstruction]) -> Result<Vec<Flight>, AmendError> {
    let slowest = model.airframe.envelope.flying_from_mps();
    Ok(flights.par_iter().map(|f| Flight::new(f, slowest)).collect::<Result<_, _>>()?)
}
