//! Initial coefficients of the prior by equation error, before the training on rollouts. The prior is the physical part of
//! the model. The residual is the network that learns the rest.
//!
//! The prior's state rates F_p are linear in the trained coefficients. Over a short window, the change of the
//! measured state less the integral of F_p along the measured path therefore gives a linear regression. A gradient
//! through rollouts converges more slowly: a fast mode (the roll damping) settles within a rollout, and after that
//! only ratios of coefficients are identifiable. \[GSFM26\] (see `src/lib.rs`) starts from the prior as given.
//!
//! A standard deviation in the model's file defines the prior distribution of its coefficient. Poorly identifiable
//! coefficients then stay near their value in the file. Coefficients without a standard deviation are estimated from
//! the flights alone. All coefficients stay within their physically possible ranges.
//!
//! A force without trained coefficients can have an error that depends on the flow angles. The residual is to learn
//! this error. The regression fits it by nuisance terms, which are then dropped. Otherwise, for example, too little
//! thrust would compensate for too little drag.

use std::ops::{AddAssign, SubAssign};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::dynamics::basis::{Basis, columns, rate_of};
use crate::dynamics::windows::{Track, Window, windows};
use greylag_model::{GreyBox, Integrator, STEP};
use greylag_num::statistics::correlation_length;
use greylag_physics::{Channel, Controls, State, Wrench};

/// Number of steps of a window, 10 ms each. The noise of the mean rate over a window is inversely proportional to
/// this number. Motions that are slower than a window remain visible.
const STEPS: usize = 5;

/// Largest number of windows used.
const WINDOWS: usize = 20_000;

/// Number of iterations: Jxz makes the regression slightly nonlinear, and the weights depend on the residuals.
const PASSES: usize = 12;

/// Error at which Tukey's weight becomes zero, in robust standard deviations. The estimate is 95 % efficient on normal
/// errors.
const REACH: f64 = 4.685;

/// Smallest robust standard deviation of a channel, as a fraction of the RMS of its regressors. It accounts for the
/// integration error along the measured path.
const FLOOR: f64 = 1e-3;

/// Channels of the regression: indices of the states whose rates depend on forces and moments (airspeed, p, q, r, alpha,
/// beta).
pub(super) const CHANNELS: [usize; 6] = [2, 3, 4, 5, 6, 7];

/// Forces that may have nuisance terms over the flow angles.
const FORCES: [Channel; 3] = [Channel::Drag, Channel::Lift, Channel::Side];

/// Number of nuisance terms: 1, α, α², α³, β².
const TERMS: usize = 5;

/// Weighting of the errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Weighting {
    /// Tukey's biweight: outliers have zero weight.
    Tukey,
    /// Equal weights: least squares.
    Alike,
}

/// Regression row of a window or a sample. Every value is divided by the characteristic scale x_c of the channel's state.
pub(super) struct Row {
    /// For each channel, the measured change of the state (window) or the residual's state rate (sample), less the value that
    /// the present parameters predict.
    pub error: [f64; 6],
    /// Derivatives of the predicted value with respect to each fitted parameter: the coordinates of the `Basis`, then the
    /// nuisance coefficients.
    pub slopes: Vec<[f64; 6]>,
}

impl Row {
    /// Updates the error after the fitted parameters have changed by `step`.
    pub fn advance(&mut self, step: &DVector<f64>) {
        for (slopes, step) in self.slopes.iter().zip(step.iter()) {
            self.error.iter_mut().zip(slopes).for_each(|(error, slope)| *error -= slope * step);
        }
    }
}

/// The fitted parameters: the coordinates in which `basis` expresses the trained coefficients, and the nuisance coefficients.
pub(super) struct Fit<'a> {
    pub basis: &'a Basis,
    /// The forces with nuisance terms: those on which no trained coefficient acts.
    along: Vec<Channel>,
    /// Nuisance coefficients of these forces, [`TERMS`] per force.
    lacking: Vec<f64>,
}

/// The coordinates η of `basis` at which `prior` fits `tracks` best. Windows with a motion that `prior` cannot represent,
/// such as a stall, have little or no weight.
pub fn coordinates(prior: &GreyBox, basis: &Basis, tracks: &[Track]) -> Vec<f64> {
    if basis.is_empty() {
        return Vec::new();
    }
    let mut eta = vec![0.0; basis.len()];
    let mut fit = Fit::new(prior, basis);
    let all = windows(tracks, STEPS);
    let every = all.len().div_ceil(WINDOWS).max(1);
    let chosen: Vec<Window> = all.into_iter().step_by(every).collect();
    let information = basis.prior_information();
    let mut model = prior.clone();
    for _ in 0..PASSES {
        basis.apply(&mut model, &eta);
        let rows: Vec<Row> = chosen.par_iter().map(|w| fit.row(&model, tracks, w)).collect();
        let known = Some((&information, eta.as_slice()));
        let Some(step) = solve(&rows, fit.count(), Weighting::Tukey, known) else { break };
        if !step.iter().all(|x| x.is_finite()) {
            break;
        }
        let values = eta.iter_mut().chain(&mut fit.lacking);
        values.zip(&step).for_each(|(value, step)| *value += step);
    }
    eta
}

/// The forces on which no trained coefficient of `prior` acts.
fn forces_along(prior: &GreyBox, basis: &Basis) -> Vec<Channel> {
    let state = State { p: 0.1, q: 0.1, r: 0.1, alpha: 0.1, beta: 0.1, ..State::NEUTRAL };
    let controls =
        Controls { aileron: 0.1, elevator: 0.1, throttle: 0.5, rudder: 0.0, lagged: None };
    let mut taken = Wrench::zero();
    prior.contributions(&state, &controls, &prior.air(&state, 0.0), |i, channel, x: f64| {
        if basis.places.contains(&i) {
            taken.add(channel, x.abs());
        }
    });
    FORCES.into_iter().filter(|c| taken.get(*c) == 0.0).collect()
}

impl<'a> Fit<'a> {
    /// A fit of the coordinates of `basis` that starts with nuisance coefficients of zero.
    pub fn new(prior: &GreyBox, basis: &'a Basis) -> Fit<'a> {
        let along = forces_along(prior, basis);
        let lacking = vec![0.0; TERMS * along.len()];
        Fit { basis, along, lacking }
    }

    /// Number of fitted parameters.
    pub fn count(&self) -> usize {
        self.basis.len() + self.lacking.len()
    }

    /// The regression row of one window with the coefficients of `model`.
    fn row(&self, model: &GreyBox, tracks: &[Track], window: &Window) -> Row {
        let basis = self.basis;
        let track = &tracks[window.track as usize];
        let start = window.start as usize;
        let scale = model.scale();
        let (before, after) =
            (track.states[start].to_array(), track.states[start + STEPS].to_array());
        let mut row = Row { error: [0.0; 6], slopes: vec![[0.0; 6]; self.count()] };
        for (e, c) in row.error.iter_mut().zip(CHANNELS) {
            *e = (after[c] - before[c]) / scale[c];
        }
        for k in 0..=STEPS {
            let at = start + k;
            let state: &State = &track.states[at];
            let rate = model.rate(state, &track.controls[at], track.altitude[at]).to_array();
            let slopes = columns(model, track, at);
            let lacking = self.rates_along(model, state, track.altitude[at]);
            for (i, c) in CHANNELS.into_iter().enumerate() {
                let weight = quadrature(model.integrator, c, k) * STEP / scale[c];
                row.error[i] -= weight * rate[c];
                for (j, sum) in row.slopes[..basis.len()].iter_mut().enumerate() {
                    let of_theta = |(p, turn): (&usize, f64)| turn * slopes[*p][c];
                    let slope: f64 = basis.places.iter().zip(basis.column(j)).map(of_theta).sum();
                    sum[i] += weight * slope;
                }
                let (coefficients, sums) = (&self.lacking, &mut row.slopes[basis.len()..]);
                for ((sum, rate), coefficient) in sums.iter_mut().zip(&lacking).zip(coefficients) {
                    sum[i] += weight * rate[c];
                    row.error[i] -= weight * rate[c] * coefficient;
                }
            }
        }
        row
    }

    /// State rates due to each nuisance term of each force, per unit of its coefficient.
    pub fn rates_along(&self, model: &GreyBox, state: &State, altitude: f64) -> Vec<[f64; 8]> {
        let air = model.air(state, altitude);
        let State { alpha, beta, .. } = *state;
        let terms: [f64; TERMS] = [1.0, alpha, alpha * alpha, alpha.powi(3), beta * beta];
        let of = |channel: Channel| {
            terms.map(|term| {
                let mut wrench = Wrench::zero();
                wrench.add(channel, air.q_s * term);
                rate_of(model, state, &air, &wrench)
            })
        };
        self.along.iter().flat_map(|channel| of(*channel)).collect()
    }
}

/// Weight of point `k` of a window in the integral of a channel's rate, in steps.
///
/// JSBSim integrates p, q and r with the rate at the start of a step. All other channels follow the trapezoidal rule to
/// second order.
fn quadrature(integrator: Integrator, channel: usize, k: usize) -> f64 {
    let spin = (3..6).contains(&channel);
    match (integrator, spin, k) {
        (Integrator::Jsbsim, true, STEPS) => 0.0,
        (Integrator::Jsbsim, true, _) => 1.0,
        (_, _, 0 | STEPS) => 0.5,
        _ => 1.0,
    }
}

/// The change of the fitted parameters that minimises the weighted sum of squared errors of `rows`. `known` describes the prior
/// distribution of the first parameters by its information matrix, and by the deviation of their present values from the prior
/// mean. `None` if there are no rows or the normal equations cannot be solved.
pub(super) fn solve(
    rows: &[Row],
    count: usize,
    weighting: Weighting,
    known: Option<(&DMatrix<f64>, &[f64])>,
) -> Option<DVector<f64>> {
    if rows.is_empty() {
        return None;
    }
    let mut normal = DMatrix::zeros(count, count);
    let mut right = DVector::zeros(count);
    for i in 0..CHANNELS.len() {
        let mut sizes: Vec<f64> = rows.iter().map(|r| r.error[i].abs()).collect();
        let middle = sizes.len() / 2;
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
        let moved = rows.iter().map(|r| r.slopes.iter().map(|s| s[i] * s[i]).sum::<f64>());
        let size = (moved.sum::<f64>() / rows.len() as f64).sqrt();
        let deviation = (1.4826 * *median).max(FLOOR * size).max(f64::MIN_POSITIVE);
        // The errors of successive rows are correlated. If a prior distribution is stated, the weights are divided by the
        // correlation length, so that the rows do not count as more information than they have.
        let said_by = match known {
            Some((information, _)) if information.iter().any(|x| *x != 0.0) => {
                let errors = rows.iter().map(|r| r.error[i].clamp(-deviation, deviation));
                correlation_length(&[errors.collect()])
            }
            _ => 1.0,
        };
        for row in rows {
            let far = match weighting {
                Weighting::Tukey => row.error[i] / (REACH * deviation),
                Weighting::Alike => 0.0,
            };
            if far.abs() < 1.0 {
                let weight = (1.0 - far * far).powi(2) / (deviation * deviation) / said_by;
                let slopes = DVector::from_iterator(count, row.slopes.iter().map(|s| s[i]));
                right.axpy(weight * row.error[i], &slopes, 1.0);
                normal.ger(weight, &slopes, &slopes, 1.0);
            }
        }
    }
    if let Some((information, from)) = known {
        let own = information.nrows();
        let pull = information * DVector::from_column_slice(from);
        normal.view_mut((0, 0), (own, own)).add_assign(information);
        right.rows_mut(0, own).sub_assign(&pull);
    }
    let size: f64 = normal.diagonal().iter().copied().fold(0.0, f64::max);
    for k in 0..count {
        // a small diagonal term leaves directions without information unchanged
        normal[(k, k)] += 1e-12 * size;
    }
    normal.cholesky().map(|c| c.solve(&right))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flights that are shorter than a window give no rows. The training then reports that it has too little data.
    #[test]
    fn no_rows_have_no_solution() {
        assert!(solve(&[], 2, Weighting::Tukey, None).is_none());
        assert!(solve(&[], 2, Weighting::Alike, None).is_none());
    }
}
