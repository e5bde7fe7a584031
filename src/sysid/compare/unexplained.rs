//! Unexplained shares of a model's channels (forces, moments and rates), without the rest of a comparison.

use super::CompareError;
use super::bins;
use super::doubt::Shift;
use super::power::Power;
use super::result::ModelResult;
use super::run::{noise, series};
use super::usable::usable;
use crate::flight_path::reconstruction::Reconstruction;
use crate::weak_form::channels::ChannelId;
use greylag_model::GreyBox;

/// Fraction of each channel's variance that a model leaves unexplained, in the order of [`ChannelId::ALL`]. NaN if it is unknown.
pub type Shares = [f64; ChannelId::ALL.len()];

/// Unexplained fractions of the variance of the channels of `model` over `flights`, dimensionless. They equal
/// [`ChannelResult::unexplained_fraction`](super::ChannelResult::unexplained_fraction) of a comparison.
///
/// # Errors
/// No flight is given or usable, or the sampling interval of a flight is not usable.
pub fn shares(model: &GreyBox, flights: &[Reconstruction]) -> Result<Shares, CompareError> {
    let (_, prepared, _) = usable(flights, model.airframe.envelope.flying_from_mps())?;
    let series = series(model, &prepared);
    // the uncertainty of the sensor errors does not change the fractions
    let unshifted = [Shift::default(); ChannelId::ALL.len()];
    let shifts: Vec<_> = prepared.iter().map(|f| vec![unshifted; f.windows.len()]).collect();
    let mut all = [f64::NAN; ChannelId::ALL.len()];
    for (share, id) in all.iter_mut().zip(ChannelId::ALL) {
        let residuals = bins::residuals(id, &prepared, &series, &shifts);
        if !residuals.is_empty() {
            *share = Power::of(&residuals, noise(id, &series)).unexplained();
        }
    }
    Ok(all)
}

impl ModelResult {
    /// The unexplained fractions of the variance of the channels.
    pub fn shares(&self) -> Shares {
        ChannelId::ALL.map(|id| {
            let of = self.channels.iter().find(|c| c.channel == id);
            of.map_or(f64::NAN, |c| c.unexplained_fraction)
        })
    }
}
