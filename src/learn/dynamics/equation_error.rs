//! A first value of the prior's coefficients by equation error, before any rollout is flown.
//!
//! F_p is linear in what is trained, so over a short window the change of the measured state less the
//! integral of F_p along the measured path is a linear regression. It finds in a second what a gradient
//! through rollouts finds slowly: a fast mode (the roll damping) settles within a rollout, after which
//! only ratios of coefficients show. The paper starts from the prior as given.
//!
//! What forces that are not trained lack over the flow angles, which the residual is to learn, is fitted along
//! and dropped: else a drag that is too small is taken for a lack of thrust.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::learn::dynamics::basis::{Basis, columns, rate_of};
use crate::learn::dynamics::windows::{Track, Window, windows};
use crate::model::{GreyBox, Integrator, STEP};
use crate::physics::{Channel, Controls, State, Wrench};

/// Steps of a window: noise of the states is divided by it, slow effects are still seen.
const STEPS: usize = 5;

/// Windows that take part, at most.
const WINDOWS: usize = 20_000;

/// Passes: Jxz bends the regression a little, and the weights follow the residuals.
const PASSES: usize = 12;

/// Where Tukey's weights end, in robust standard deviations: 95 % efficient on normal errors.
const REACH: f64 = 4.685;

/// Part of a channel's own size below which an error is no error: integration of the path.
const FLOOR: f64 = 1e-3;

/// The rates that forces and moments make: airspeed, p, q, r, alpha, beta.
const CHANNELS: [usize; 6] = [2, 3, 4, 5, 6, 7];

/// Channels in which the prior may lack something over the flow angles.
const FORCES: [Channel; 3] = [Channel::Drag, Channel::Lift, Channel::Side];

/// Terms of what it may lack: 1, α, α², α³, β².
const TERMS: usize = 5;

/// A window: for each channel its error in units of x_c, and the slopes of the prediction.
struct Row {
    error: [f64; 6],
    /// With respect to the coordinates, then to what the prior may lack.
    slopes: Vec<[f64; 6]>,
}

/// What is fitted.
struct Fit<'a> {
    basis: &'a Basis,
    /// The forces that are fitted along: those on which no trained coefficient acts.
    along: Vec<Channel>,
    /// What they come to, [`TERMS`] coefficients a force.
    lacking: Vec<f64>,
}

/// The coordinates at which `prior` follows `tracks` best, windows that it cannot follow (a stall that
/// it does not have) counting little or nothing.
pub fn coordinates(prior: &GreyBox, basis: &Basis, tracks: &[Track]) -> Vec<f64> {
    if basis.is_empty() {
        return Vec::new();
    }
    let mut eta = vec![0.0; basis.len()];
    let along = forces_along(prior, basis);
    let lacking = vec![0.0; TERMS * along.len()];
    let mut fit = Fit { basis, along, lacking };
    let all = windows(tracks, STEPS);
    let every = all.len().div_ceil(WINDOWS).max(1);
    let chosen: Vec<Window> = all.into_iter().step_by(every).collect();
    let mut model = prior.clone();
    for _ in 0..PASSES {
        basis.apply(&mut model, &eta);
        let rows: Vec<Row> = chosen.par_iter().map(|w| fit.row(&model, tracks, w)).collect();
        let Some(step) = solve(&rows, eta.len() + fit.lacking.len()) else { break };
        if !step.iter().all(|x| x.is_finite()) {
            break;
        }
        let values = eta.iter_mut().chain(&mut fit.lacking);
        values.zip(&step).for_each(|(value, step)| *value += step);
    }
    eta
}

/// The forces on which none of the trained coefficients of `prior` acts.
fn forces_along(prior: &GreyBox, basis: &Basis) -> Vec<Channel> {
    let state = State { p: 0.1, q: 0.1, r: 0.1, alpha: 0.1, beta: 0.1, ..State::NEUTRAL };
    let controls = Controls { aileron: 0.1, elevator: 0.1, throttle: 0.5, rudder: 0.0 };
    let mut taken = Wrench::zero();
    prior.contributions(&state, &controls, &prior.air(&state, 0.0), |i, channel, x: f64| {
        if basis.places.contains(&i) {
            taken.add(channel, x.abs());
        }
    });
    FORCES.into_iter().filter(|c| taken.get(*c) == 0.0).collect()
}

impl Fit<'_> {
    /// One window at the coefficients of `model`.
    fn row(&self, model: &GreyBox, tracks: &[Track], window: &Window) -> Row {
        let basis = self.basis;
        let track = &tracks[window.track as usize];
        let start = window.start as usize;
        let scale = model.scale();
        let (before, after) =
            (track.states[start].to_array(), track.states[start + STEPS].to_array());
        let mut row =
            Row { error: [0.0; 6], slopes: vec![[0.0; 6]; basis.len() + self.lacking.len()] };
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

    /// The rates that each term of each force that is fitted along makes.
    fn rates_along(&self, model: &GreyBox, state: &State, altitude: f64) -> Vec<[f64; 8]> {
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
/// JSBSim moves p, q and r by the rate at a step's start; all else is trapezoidal to second order.
fn quadrature(integrator: Integrator, channel: usize, k: usize) -> f64 {
    let spin = (3..6).contains(&channel);
    match (integrator, spin, k) {
        (Integrator::Jsbsim, true, STEPS) => 0.0,
        (Integrator::Jsbsim, true, _) => 1.0,
        (_, _, 0 | STEPS) => 0.5,
        _ => 1.0,
    }
}

/// The step of the coordinates that a weighted least-squares fit asks for.
fn solve(rows: &[Row], count: usize) -> Option<DVector<f64>> {
    let mut normal = DMatrix::zeros(count, count);
    let mut right = DVector::zeros(count);
    for i in 0..CHANNELS.len() {
        let mut sizes: Vec<f64> = rows.iter().map(|r| r.error[i].abs()).collect();
        let middle = sizes.len() / 2;
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
        let moved = rows.iter().map(|r| r.slopes.iter().map(|s| s[i] * s[i]).sum::<f64>());
        let size = (moved.sum::<f64>() / rows.len() as f64).sqrt();
        let deviation = (1.4826 * *median).max(FLOOR * size).max(f64::MIN_POSITIVE);
        for row in rows {
            let far = row.error[i] / (REACH * deviation);
            if far.abs() < 1.0 {
                let weight = (1.0 - far * far).powi(2) / (deviation * deviation);
                let slopes = DVector::from_iterator(count, row.slopes.iter().map(|s| s[i]));
                right.axpy(weight * row.error[i], &slopes, 1.0);
                normal.ger(weight, &slopes, &slopes, 1.0);
            }
        }
    }
    let size: f64 = normal.diagonal().iter().copied().fold(0.0, f64::max);
    for k in 0..count {
        // a direction that no window shows stays
        normal[(k, k)] += 1e-12 * size;
    }
    normal.cholesky().map(|c| c.solve(&right))
}
