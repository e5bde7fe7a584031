//! Regressors of an equation-error fit in weak form: the contribution of each coefficient of a model to the smoothed forces and
//! moments of each window.

use rayon::prelude::*;

use crate::flight_path::reconstruction::Instant;
use crate::weak_form::prepared::{Prepared, Window};
use crate::weak_form::windows::{CHUNK, predicted_force};
use greylag_logs::Sampling;
use greylag_model::{GreyBox, Integrator};
use greylag_physics::{Channel, Controls, Wrench};

/// Linear part of a model in weak form: the contribution of each coefficient per unit of the coefficient.
#[derive(Clone, Debug)]
pub struct Columns {
    /// Names of the coefficients, as in the model.
    pub names: Vec<String>,
    /// Contributions `values[coefficient][channel][window]`, channels D, L, Y, l, m, n. Weighted by the coefficients, their sum
    /// is the predicted value in [`Series`](crate::weak_form::windows::Series).
    pub values: Vec<[Vec<f64>; 6]>,
}

/// Columns of `model` over the windows of `flight`, as regressors for the measured channels.
///
/// Columns of zeros belong to shape constants, in which the model is nonlinear, and to coefficients of effects on inputs or
/// inertia, which act on the measured side.
pub fn columns(model: &GreyBox, flight: &Prepared) -> Columns {
    let flight = &*flight.acting(model);
    let names: Vec<String> = model.coefficients().iter().map(|c| c.name.clone()).collect();
    let parts: Vec<Vec<[Vec<f64>; 6]>> = flight
        .windows
        .par_chunks(CHUNK)
        .map(|windows| columns_of(model, flight, windows, names.len()))
        .collect();
    let joined = |index: usize, channel: usize| {
        parts.iter().flat_map(|part| &part[index][channel]).copied().collect()
    };
    let values = (0..names.len()).map(|index| std::array::from_fn(|k| joined(index, k))).collect();
    Columns { names, values }
}

/// Values of [`Columns::values`] for some windows.
fn columns_of(
    model: &GreyBox,
    flight: &Prepared,
    windows: &[Window],
    coefficients: usize,
) -> Vec<[Vec<f64>; 6]> {
    let mut values: Vec<[Vec<f64>; 6]> =
        vec![std::array::from_fn(|_| vec![0.0; windows.len()]); coefficients];
    for (w, window) in windows.iter().enumerate() {
        let mut add = |index: usize, channel: usize, amount: f64| {
            values[index][channel][w] += amount;
        };
        let (kernel, samples) = (&flight.kernel, flight.samples(window));
        let held = flight.sampling == Sampling::Held;
        let both_ends = held && model.integrator == Integrator::Rk4;
        for (k, at) in samples.iter().enumerate() {
            let step = kernel.step.get(k).copied().unwrap_or(0.0);
            let of_moment = match (held, both_ends) {
                (false, _) => kernel.sample[k],
                (true, false) => step,
                (true, true) => 0.5 * step,
            };
            columns_at(model, at, &at.controls, [kernel.sample[k], of_moment], &mut add);
            if let Some(to) = samples.get(k + 1).filter(|_| both_ends) {
                columns_at(model, to, &at.controls, [0.0, of_moment], &mut add);
            }
        }
    }
    values
}

/// Adds the contributions at the state of `at`. Those to forces are multiplied by `of_force`, those to moments by `of_moment`.
/// Nothing is added for a factor of zero.
fn columns_at(
    model: &GreyBox,
    at: &Instant,
    controls: &Controls,
    [of_force, of_moment]: [f64; 2],
    add: &mut impl FnMut(usize, usize, f64),
) {
    let air = model.air(&at.state, at.altitude);
    model.contributions(&at.state, controls, &air, |index, channel, amount: f64| {
        let place = match channel {
            Channel::Drag | Channel::Lift | Channel::Side | Channel::BodyX => None,
            Channel::Roll => Some(3),
            Channel::Pitch => Some(4),
            Channel::Yaw => Some(5),
        };
        match place {
            Some(place) if of_moment != 0.0 => add(index, place, of_moment * amount),
            None if of_force != 0.0 => {
                let mut wrench = Wrench::zero();
                wrench.add(channel, of_force * amount);
                let force = predicted_force(model, &wrench, &air);
                (0..3).for_each(|k| add(index, k, force[k]));
            }
            _ => {}
        }
    });
}
