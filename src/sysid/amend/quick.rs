//! What is known of an effect at once, before free runs have fitted it.

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

/// A model by equation error alone: forces and moments fitted, no free run.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// The model.
    pub model: GreyBox,
    /// Its free-run errors on the flights held out, at the horizons of [`Options`].
    pub after: Vec<HorizonScore>,
}

/// `model` tuned to `flights`, no effect added: what [`Options::tuned`] takes.
///
/// # Errors
/// The flights do not allow a fit, or `progress` ended it.
pub fn tune(
    model: &GreyBox,
    flights: &[Reconstruction],
    progress: &Progress,
) -> Result<Fit, AmendError> {
    output_error::fit(model, &ready(model, flights)?, &FitOptions::default(), progress)
}

/// `model` with `effects` by equation error over `flights`, and how its free runs do on `held_out`.
///
/// # Errors
/// An effect cannot join the model, or a flight has no clock.
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

/// The flights as a fit takes them.
fn ready(model: &GreyBox, flights: &[Reconstruction]) -> Result<Vec<Flight>, AmendError> {
    let slowest = model.airframe.envelope.flying_from_mps();
    Ok(flights.par_iter().map(|f| Flight::new(f, slowest)).collect::<Result<_, _>>()?)
}
