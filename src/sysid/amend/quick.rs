//! Fast estimates: a fit without added effects, and equation-error estimates with added effects.

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

/// A model estimated by equation error only: from forces and moments, without free runs.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The estimated model.
    pub model: GreyBox,
    /// Free-run errors of the model on the held-out flights, at the default horizons of [`Options`].
    pub after: Vec<HorizonScore>,
}

/// Fits the coefficients of `model` to `flights` without added effects. The result is suitable for [`Options::tuned`].
///
/// # Errors
/// The flights do not allow a fit (see `AmendError`), or `progress` cancelled.
pub fn tune(
    model: &GreyBox,
    flights: &[Reconstruction],
    progress: &Progress,
) -> Result<Fit, AmendError> {
    output_error::fit(model, &ready(model, flights)?, &FitOptions::default(), progress)
}

/// Estimates `model` with `effects` by equation error over `flights`, and computes its free-run errors on `held_out`.
///
/// # Errors
/// An effect cannot join the model, or the sampling interval of a flight is not usable.
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

/// The flights prepared for a fit.
fn ready(model: &GreyBox, flights: &[Reconstruction]) -> Result<Vec<Flight>, AmendError> {
    let slowest = model.airframe.envelope.flying_from_mps();
    Ok(flights.par_iter().map(|f| Flight::new(f, slowest)).collect::<Result<_, _>>()?)
}
