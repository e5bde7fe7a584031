//! The flights of a leave-one-out cross-validation, and the errors of models and baselines on the flights left out.

use rayon::prelude::*;

use super::{Combined, Effort, Fitted, Scored, Structure, scored};
use crate::amend::flight::Flight;
use crate::amend::judge::{Judge, judged};
use crate::amend::linear_residual;
use crate::compare::HorizonScore;
use crate::compare::combination::{EVERY_S, Forecasts, choose as choose_weights, mean_state};
use crate::compare::forecast;
use crate::weak_form::prepared::Prepared;
use greylag_model::GreyBox;

/// For each flight that is left out, the model that was fitted to all other flights; `None` if the fit failed.
pub(super) type Models = Vec<Option<GreyBox>>;

/// The flights of a cross-validation.
pub(super) struct Set<'a> {
    /// All flights as reconstructed, for the predictions.
    pub judged: &'a [Flight],
    /// The same flights, corrected for the sensor errors and misaligned axes that the model's file states, for the fits.
    pub fitted: &'a [Flight],
    /// Indices of the flights that are long enough to be predicted. The other flights are only used in fits.
    pub judges: &'a [usize],
    /// Horizon of the errors, s.
    pub at: f64,
}

/// Errors of the baseline forecasts: held state, straight flight, and a linear model fitted to the other flights.
pub(super) fn black_boxes(model: &GreyBox, set: &Set) -> Vec<Scored> {
    let names = ["hold the state", "fly straight on", "linear (ARX), fitted to the others"];
    let mut errors = vec![Vec::new(); names.len()];
    for &left in set.judges {
        let others: Vec<Prepared> = set.without(left).cloned().collect();
        let one = std::slice::from_ref(&set.judged[left].prepared);
        let results = forecast::on_unseen(&others, one, model.scale(), &[set.at]);
        for (k, list) in errors.iter_mut().enumerate() {
            list.push(results.get(k).map_or(f64::NAN, |r| r.free_run[0].rmse_scaled));
        }
    }
    let of = |(name, errors): (&str, Vec<f64>)| {
        let (fitted, effort) = (Fitted::Nothing, Effort::Complete);
        scored(&Structure { name: name.into(), fitted, effort }, 0, errors)
    };
    names.into_iter().zip(errors).map(of).collect()
}

pub(super) fn scores(model: &GreyBox, test: &[Flight], horizons_s: &[f64]) -> Vec<HorizonScore> {
    Judge { test, horizons_s }.scores(model)
}

impl Set<'_> {
    /// All flights except the one with the index `left`.
    fn without(&self, left: usize) -> impl Iterator<Item = &Prepared> {
        let others = self.judged.iter().enumerate().filter(move |(k, _)| *k != left);
        others.map(|(_, flight)| &flight.prepared)
    }

    /// Error of each predicted flight with the model that was fitted to all other flights; NaN without a model.
    pub fn errors(&self, models: &[Option<GreyBox>]) -> Vec<f64> {
        let one = |(left, model): (&usize, &Option<GreyBox>)| {
            let Some(model) = model else { return f64::NAN };
            let test = std::slice::from_ref(&self.judged[*left]);
            judged(&scores(model, test, &[self.at])).unwrap_or(f64::NAN)
        };
        self.judges.par_iter().zip(models).map(one).collect()
    }

    /// `models`, each with its linear residual.
    pub fn with_residuals(&self, models: &[Option<GreyBox>]) -> Models {
        let one = |(left, model): (&usize, &Option<GreyBox>)| {
            Some(corrected(model.clone()?, self, *left))
        };
        self.judges.par_iter().zip(models).map(one).collect()
    }

    /// What `models` reach together with the held and the mean state. `None` if fewer than two flights have a model.
    pub fn combined(&self, models: &[Option<GreyBox>]) -> Option<Combined> {
        let one = |(left, model): (&usize, &Option<GreyBox>)| {
            let (model, mean_state) = (model.as_ref()?, mean_state(self.without(*left)));
            let flight = &self.judged[*left].prepared;
            Some(Forecasts::of_model(model, flight, &[self.at], EVERY_S, None, mean_state))
        };
        let parts: Vec<Forecasts> = self.judges.par_iter().zip(models).filter_map(one).collect();
        let chosen = choose_weights(&parts)?;
        let weight_of_model = chosen.combination.of_model()[0];
        Some(Combined { error: chosen.error, weight_of_model })
    }
}

/// `model` with its linear residual over all flights except the one with the index `left`; `model` if no residual helps.
fn corrected(model: GreyBox, set: &Set, left: usize) -> GreyBox {
    let others: Vec<Prepared> = set.without(left).cloned().collect();
    linear_residual::fit(&model, &others, &[set.at]).map_or(model, |found| found.model)
}
