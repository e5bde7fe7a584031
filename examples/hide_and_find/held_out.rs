//! Errors of models on held-out flights.

use greylag::model::GreyBox;
use greylag::sysid::compare::free_run;
use greylag::sysid::weak_form::prepared::Prepared;

/// Duration of the open-loop simulations, s.
const HORIZON_S: f64 = 5.0;

/// Root mean square error of open-loop simulations of `model` over 5 s, divided by the state's scale x_c.
pub fn error(model: &GreyBox, flights: &[Prepared]) -> f64 {
    let (runs, _) = free_run::fly(model, flights, &[HORIZON_S]);
    runs.score(HORIZON_S).rmse_scaled
}
