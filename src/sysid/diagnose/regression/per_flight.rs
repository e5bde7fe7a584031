//! Regressors (columns) of the constants of each flight: misalignment angles of the measured axes, and trims, which are
//! constants added to force and moment coefficients.

use crate::diagnose::regression::columns::Ready;
use crate::diagnose::regression::gather::{Column, gather, rates};
use crate::diagnose::regression::local::{self, ALPHA, RATES};
use crate::flight_path::reconstruction::Instant;
use crate::per_flight::{PerFlight, askew, trims};
use crate::weak_form::windows::{inertia, to_force_axes};
use greylag_model::GreyBox;
use greylag_physics::rigid_body::Vector;

/// Regressors of the constants `asked` for `flight` under `model`, in the order of [`PerFlight::constants`].
pub fn columns(asked: &PerFlight, model: &GreyBox, flight: &Ready) -> Vec<Column> {
    let mut columns = Vec::new();
    if asked.askew_deg.is_some() {
        columns.extend(of_axes(model, flight));
    }
    if asked.has_trims() {
        columns.extend(of_trims(model, flight));
    }
    columns
}

/// Regressors of the trims. Forces and moments are linear in the trims.
fn of_trims(model: &GreyBox, flight: &Ready) -> Vec<Column> {
    let count = model.coefficients().len();
    match trims::joined(model) {
        Ok(with) => flight.linear(&with, count..count + trims::TRIMS.len()),
        Err(_) => vec![Column::default(); trims::TRIMS.len()],
    }
}

/// Regressors of the misalignment angles of the measured axes. All quantities that are measured in these axes rotate,
/// including the angular acceleration.
fn of_axes(model: &GreyBox, flight: &Ready) -> Vec<Column> {
    let angles = askew::NAMES.len();
    let mut columns = gather(&flight.acting, model.integrator, angles, |place, add| {
        let at = place.at;
        let slope = local::local(model, at, place.controls).slope;
        let air = model.air(&at.state, at.altitude);
        let turned = askew::vector(body_rates(at));
        let flow = flight.acting.turning.at(at.state.alpha, at.state.beta);
        let force = askew::vector(at.specific_force);
        for axis in 0..angles {
            let [p, q, r] = turned[axis];
            let [alpha, beta] = flow[axis];
            let moved =
                [(RATES, p), (RATES + 1, q), (RATES + 2, r), (ALPHA, alpha), (ALPHA + 1, beta)];
            for (input, by) in moved {
                slope[input].iter().enumerate().for_each(|(c, s)| add(axis, c, by * s));
            }
            if force[axis].iter().all(|f| f.is_finite()) {
                let force = force[axis].map(|f| f * model.body.mass);
                let force = to_force_axes(force, &air, model.axes);
                force.iter().enumerate().for_each(|(c, f)| add(axis, c, *f));
            }
        }
    });
    for (axis, column) in columns.iter_mut().enumerate() {
        let spins = rates(&flight.acting, |i| askew::vector(body_rates(i))[axis]);
        let moments: Vec<Vector<f64>> = spins.iter().map(|w| inertia(&model.body, *w)).collect();
        for (k, list) in column[3..].iter_mut().enumerate() {
            list.resize(moments.len(), 0.0);
            list.iter_mut().zip(&moments).for_each(|(x, m)| *x += m[k]);
        }
    }
    columns
}

fn body_rates(at: &Instant) -> [f64; 3] {
    [at.state.p, at.state.q, at.state.r]
}
