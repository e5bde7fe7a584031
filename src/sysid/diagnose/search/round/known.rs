//! Nuisance parameters of a round, with their regressors: free coefficients of the model, constants of each flight,
//! sensor errors. A round is a model linearised over all flights.

use super::Problem;
use crate::diagnose::regression::catalogue::{self, Entry};
use crate::diagnose::regression::cells::Placed;
use crate::diagnose::regression::columns::{Ready, SENSORS, combine};
use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::projected::{Known, Projected};
use crate::diagnose::regression::{per_flight, sensors};
use greylag_model::GreyBox;

/// Nuisance parameters, indices of the free coefficients among those of the model, and regressors (columns) by flight.
type KnownColumns = (Vec<Known>, Vec<usize>, Vec<Placed>);

/// Returns the nuisance parameters and their columns. The free coefficients come first, then the constants of all
/// flights, then the sensor errors of all flights. `linear_columns` holds, by flight, the columns of the coefficients
/// in which the model is linear.
pub(super) fn known(
    problem: &Problem,
    model: &GreyBox,
    flights: &[Ready],
    linear_columns: Vec<Vec<Column>>,
) -> KnownColumns {
    let (mut known, mut coefficients) = (Vec::new(), Vec::new());
    let mut placed: Vec<Placed> = vec![Vec::new(); flights.len()];
    let linear = model.linear();
    for (index, named) in model.coefficients().iter().enumerate() {
        // a nonlinear coefficient of an added effect has a prior as wide as the reach of its linearisation
        let joined =
            if linear[index] { f64::INFINITY } else { catalogue::REACH * named.value.abs() };
        let (value, width) = problem.prior.get(index).copied().unwrap_or((named.value, joined));
        let held = width <= 0.0 || model.replaced(&named.name).is_some();
        if held || !searched(model, index) {
            continue;
        }
        for ((list, flight), columns) in placed.iter_mut().zip(flights).zip(&linear_columns) {
            let column = match linear[index] {
                true => columns[index].clone(),
                false => tangent(model, flight, index),
            };
            list.push((known.len(), column));
        }
        coefficients.push(index);
        known.push(Known { name: named.name.clone(), width, offset: value - named.value });
    }
    let constants = problem.per_flight.constants();
    for (list, flight) in placed.iter_mut().zip(flights) {
        let columns = per_flight::columns(&problem.per_flight, model, flight);
        for (constant, column) in constants.iter().zip(columns) {
            list.push((known.len(), column));
            let name = format!("{} of flight {}", constant.name, flight.measured.name);
            known.push(Known { name, width: constant.width, offset: 0.0 });
        }
    }
    for (k, (list, flight)) in placed.iter_mut().zip(flights).enumerate() {
        for (i, column) in flight.sensors.iter().enumerate() {
            list.push((known.len(), column.clone()));
            known.push(Known {
                name: format!("{} of flight {}", sensors::NAMES[i], flight.measured.name),
                width: problem.sensors[k][i],
                offset: sensors::mean(i),
            });
        }
    }
    (known, coefficients, placed)
}

/// Corrects the prior of each flight's actuator averaging ("blur") for the second-order effect of the estimated delay.
/// A record of u with a delay of λ samples is u − λu' + ½λ²u''. The regressor of the delay contains only the
/// first-order term. Without the second-order term, a delay of one sample would be mistaken for an actuator lag.
pub(super) fn curved(problem: &Problem, known: &mut [Known], projected: &Projected) {
    let first = known.len().saturating_sub(problem.flights.len() * SENSORS);
    for (k, flight) in problem.flights.iter().enumerate() {
        let own = first + k * SENSORS;
        let (late, blur) = (own + sensors::LATE_PLACE, own + sensors::BLUR_PLACE);
        let samples = projected.tuned[late] / flight.dt;
        let unsure = projected.covariance[(late, late)].max(0.0).sqrt() / flight.dt;
        let [mean, sd] = sensors::BLURRED;
        known[blur].offset = mean - 0.5 * samples * samples;
        known[blur].width = sd.hypot(samples * unsure);
    }
}

/// Whether the coefficient with the index `index` is estimated. A linear coefficient that is 1 in all starting points
/// of its effect is fixed.
fn searched(model: &GreyBox, index: usize) -> bool {
    let name = &model.coefficients()[index].name;
    let Some((id, own)) = name.split_once('.') else { return true };
    let Some(about) = model.effects().find(|about| about.id == id) else { return true };
    let entry = Entry { about, operator: false };
    let starts = about.entry.map_or(0, |e| e.starts.len());
    starts == 0 || catalogue::free(&entry).iter().any(|k| about.coefficients[*k].name == own)
}

/// Derivative of the predicted forces and moments with respect to a coefficient in which the model is nonlinear, by
/// finite differences.
fn tangent(model: &GreyBox, flight: &Ready, index: usize) -> Column {
    let named = &model.coefficients()[index];
    let by = (0.02 * named.value.abs()).max(1e-4);
    let moved = |by: f64| {
        let mut moved = model.clone();
        moved.set_coefficient(&named.name, named.value + by);
        moved
    };
    let id = named.name.split('.').next().unwrap_or_default();
    let own: Vec<usize> = (0..model.coefficients().len())
        .filter(|k| model.coefficients()[*k].name.split('.').next() == Some(id))
        .collect();
    let linear = model.linear();
    let of = |model: &GreyBox| {
        if own.iter().all(|k| !linear[*k]) {
            return flight.operator(model);
        }
        let (first, last) = (own[0], own[own.len() - 1] + 1);
        let values: Vec<f64> = (first..last)
            .map(|k| if linear[k] { model.coefficients()[k].value } else { 0.0 })
            .collect();
        combine(&flight.linear(model, first..last), &values)
    };
    // the step down must not make a lag, a delay or a dead zone negative
    let down = by.min(named.value.max(0.0));
    combine(&[of(&moved(by)), of(&moved(-down))], &[1.0 / (by + down), -1.0 / (by + down)])
}
