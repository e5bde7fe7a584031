//! Models judged on flights that no fit has seen.

use greylag::model::GreyBox;
use greylag::sysid::compare::free_run;
use greylag::sysid::weak_form::prepared::Prepared;

/// Horizon of the free runs, s.
const HORIZON_S: f64 = 5.0;

/// Root mean square error of free runs of `model` over 5 s, scaled by x_c.
pub fn error(model: &GreyBox, flights: &[Prepared]) -> f64 {
    let (runs, _) = free_run::fly(model, flights, &[HORIZON_S]);
    runs.score(HORIZON_S).rmse_scaled
}
