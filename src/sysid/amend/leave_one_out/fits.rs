//! The fits of a leave-one-out cross-validation: complete, or screened by a few steps from the fit of the coefficients alone.

use super::set::{Models, Set};
use super::{Effort, Fitted, Scored, Structure, scored};
use crate::amend::amendment::{Added, joined};
use crate::amend::error::AmendError;
use crate::amend::linear_residual;
use crate::amend::output_error::{self, FitOptions, Folds, Near};
use crate::amend::parameters;
use crate::per_flight::{PerFlight, SensorErrors};
use greylag_model::GreyBox;

/// The fits of a model to a set of flights, and what later fits take over from earlier ones.
pub(super) struct Fits<'a> {
    /// The model as given.
    model: &'a GreyBox,
    set: &'a Set<'a>,
    /// The models whose coefficients alone were fitted.
    tuned: Option<Models>,
    /// The fit of the coefficients alone to all flights.
    near: Option<Near>,
    /// The first error of a fit.
    failed: Option<AmendError>,
    /// Whether any fit succeeded.
    any: bool,
}

impl<'a> Fits<'a> {
    /// No fits yet, of `model` to the flights of `set`.
    pub fn of(model: &'a GreyBox, set: &'a Set<'a>) -> Fits<'a> {
        Fits { model, set, tuned: None, near: None, failed: None, any: false }
    }

    /// The first error, if no fit succeeded; `None` if no fit was tried.
    pub fn failure(&mut self) -> Option<AmendError> {
        self.failed.take().filter(|_| !self.any)
    }

    /// Fits `structure` without each of the predicted flights.
    ///
    /// # Errors
    /// If an effect cannot be added to the model. Errors of the fits themselves give models that are `None`.
    pub fn complete(&mut self, structure: &Structure) -> Result<Scored, AmendError> {
        let fitted = &structure.fitted;
        let known = match fitted {
            Fitted::Nothing => Some(vec![Some(self.model.clone()); self.set.judges.len()]),
            Fitted::LinearResidual => self.tuned.clone(),
            _ => None,
        };
        let mut models = match known {
            Some(models) => models,
            None => self.fit(fitted)?,
        };
        self.any |= !matches!(fitted, Fitted::Nothing) && models.iter().any(Option::is_some);
        if fitted.tunes_only() {
            self.tuned = Some(models.clone());
        }
        if matches!(fitted, Fitted::LinearResidual) {
            models = self.set.with_residuals(&models);
        }
        let combined = self.set.combined(&models);
        let of = scored(structure, fitted.free(self.model)?, self.set.errors(&models));
        Ok(Scored { models, combined, ..of })
    }

    /// Estimates `structure` without each of the predicted flights by a few steps from the fit of the coefficients alone. The
    /// errors are NaN if there is no such fit.
    ///
    /// # Errors
    /// If an effect cannot be added to the model.
    pub fn screened(&self, structure: &Structure) -> Result<Scored, AmendError> {
        let (start, options) = structure.fitted.start(self.model)?;
        let Set { fitted, judges, .. } = *self.set;
        let steps =
            |near: &Near| output_error::screened(&start, fitted, &options.added, near, judges).ok();
        let models = self.near.as_ref().and_then(steps);
        let models = models.unwrap_or_else(|| vec![None; judges.len()]);
        let of = scored(structure, structure.fitted.free(self.model)?, self.set.errors(&models));
        Ok(Scored { screened: true, ..of })
    }

    /// Fits the structure `fitted` without each of the predicted flights.
    fn fit(&mut self, fitted: &Fitted) -> Result<Models, AmendError> {
        let anew =
            matches!(fitted, Fitted::Coefficients { per_flight, .. } if per_flight.angles() > 0);
        let flights = if anew { self.set.judged } else { self.set.fitted };
        let (start, options) = fitted.start(self.model)?;
        let without = match fitted {
            Fitted::FromScratch => output_error::without_each_anew,
            _ => output_error::without_each,
        };
        let Folds { fits, near } = without(&start, flights, &options, self.set.judges);
        if fitted.tunes_only() {
            self.near = near;
        }
        let mut models = Vec::with_capacity(fits.len());
        for fit in fits {
            match fit {
                Ok(fit) => models.push(Some(fit.model)),
                Err(why) => {
                    self.failed = self.failed.take().or(Some(why));
                    models.push(None);
                }
            }
        }
        Ok(models)
    }
}

impl Structure {
    /// Whether the structure is screened: it must have the constants of each flight that the fit of the coefficients alone has.
    pub(super) fn is_screened(&self) -> bool {
        let alike = match &self.fitted {
            Fitted::Widened(_) => true,
            Fitted::Coefficients { per_flight, .. } => {
                unjudged(per_flight) == unjudged(&PerFlight::default())
            }
            Fitted::Nothing | Fitted::LinearResidual | Fitted::FromScratch => false,
        };
        alike && self.effort == Effort::Screened
    }
}

impl Fitted {
    /// Whether only the model's coefficients are fitted, or a linear residual after them.
    fn tunes_only(&self) -> bool {
        match self {
            Fitted::LinearResidual => true,
            Fitted::Coefficients { effects, per_flight } => {
                effects.is_empty() && unjudged(per_flight) == unjudged(&PerFlight::default())
            }
            Fitted::Nothing | Fitted::FromScratch | Fitted::Widened(_) => false,
        }
    }

    /// The model from which the fit of `model` starts, and the options of the fit.
    fn start(&self, model: &GreyBox) -> Result<(GreyBox, FitOptions), AmendError> {
        let of = |per_flight| FitOptions { per_flight, ..FitOptions::default() };
        let usual = of(unjudged(&PerFlight::default()));
        Ok(match self {
            Fitted::Nothing | Fitted::LinearResidual => (model.clone(), usual),
            Fitted::Widened(factor) => (parameters::widened(model, *factor), usual),
            Fitted::FromScratch => {
                let sensors = SensorErrors::Dropped;
                let per_flight = PerFlight { sensors, ..PerFlight::default() };
                (parameters::from_scratch(model), of(per_flight))
            }
            Fitted::Coefficients { effects, per_flight } => {
                let added = effects.iter().map(|a| a.id.clone()).collect();
                (with(model, effects)?, FitOptions { added, ..of(unjudged(per_flight)) })
            }
        })
    }

    /// Number of free coefficients in a fit of `model`, plus the number of constants of one flight.
    fn free(&self, model: &GreyBox) -> Result<usize, AmendError> {
        Ok(match self {
            Fitted::Nothing => 0,
            Fitted::Widened(_) => parameters::free(model, &[]).len(),
            Fitted::LinearResidual => parameters::free(model, &[]).len() + linear_residual::FREE,
            Fitted::FromScratch => parameters::free(&parameters::from_scratch(model), &[]).len(),
            Fitted::Coefficients { effects, per_flight } => {
                let ids: Vec<&str> = effects.iter().map(|a| a.id.as_str()).collect();
                parameters::free(&with(model, effects)?, &ids).len() + per_flight.constants().len()
            }
        })
    }
}

/// `per_flight` without common sensor errors, unless they are kept in any case: no other flight is left to judge them.
fn unjudged(per_flight: &PerFlight) -> PerFlight {
    let sensors = match per_flight.sensors {
        SensorErrors::Kept => SensorErrors::Kept,
        SensorErrors::Judged | SensorErrors::Dropped => SensorErrors::Dropped,
    };
    PerFlight { sensors, ..*per_flight }
}

fn with(model: &GreyBox, effects: &[Added]) -> Result<GreyBox, AmendError> {
    let mut with = model.clone();
    effects.iter().try_for_each(|added| joined(&mut with, added))?;
    Ok(with)
}
