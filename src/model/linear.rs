//! Linear model of one time step about a flight condition. Its derivatives are exact, by dual numbers.

use nalgebra::SMatrix;

use super::jacobian::jacobian;
use super::{GreyBox, Memory, Trim};
#[cfg(target_arch = "x86_64")]
use greylag_num::{Dual, Real, each};
use greylag_physics::{Controls, State};

const STATES: usize = 8;
/// Number of inputs of a step: eight states and four controls.
const INPUTS: usize = 12;

/// Linear model of one step of 0.01 s about a flight condition: δs₊ = a δs + b δz. Here s is the state, s₊ the next state and
/// z = (δa, δe, δt, δr) the controls. Units are rad, m/s, rad/s and throttle 0..1.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Jacobian ∂s₊/∂s, with states in the order of eq. (4).
    pub a: SMatrix<f64, 8, 8>,
    /// Jacobian ∂s₊/∂(δa, δe, δt, δr).
    pub b: SMatrix<f64, 8, 4>,
}

/// Linearises one step of `model` about `trim` at `altitude` (m).
///
/// The integrator remembers the last acceleration, which is taken as equal to the present one. The controls are the acting
/// deflections and throttle. The model's input effects (lag, delay, dead zone) are omitted, because they have their own states.
pub fn linearise(model: &GreyBox, trim: &Trim, altitude: f64) -> Linear {
    linearise_step(model, &trim.state, &trim.controls, altitude)
}

/// Linearises one step of `model` about any state, steady or not, at `altitude` (m).
///
/// No multiply-add is fused, so that all processors give bit-identical results.
pub fn linearise_step(
    model: &GreyBox,
    state: &State,
    controls: &Controls,
    altitude: f64,
) -> Linear {
    let x = inputs(state, controls);
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the feature
        let rows = unsafe { in_avx2(model, &x, altitude) };
        let (a, b) = matrices(rows);
        return Linear { a, b };
    }
    let (_, rows) = jacobian(&x, |x| {
        let (state, controls) = split(x);
        model.step(&state, &controls, altitude, &mut Memory::default()).to_array()
    });
    let (a, b) = matrices(rows);
    Linear { a, b }
}

/// The Jacobian of a step, row by row. The derivatives by all twelve inputs are computed at once, because planners spend most of
/// their time in this function.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn in_avx2(model: &GreyBox, x: &[f64; INPUTS], altitude: f64) -> [[f64; INPUTS]; STATES] {
    let mut duals = [Dual::<INPUTS>::from_f64(0.0); INPUTS];
    for (i, dual) in duals.iter_mut().enumerate() {
        *dual = Dual::variable(x[i], i);
    }
    let (state, controls) = split(duals);
    let next = model.step_inlined(&state, &controls, altitude, &mut Memory::default()).to_array();
    each(next, |component| component.gradient)
}

/// The inputs of a step: eight states, then aileron, elevator, throttle and rudder.
pub(super) fn inputs(state: &State, controls: &Controls) -> [f64; INPUTS] {
    let mut x = [controls.rudder; INPUTS];
    x[..STATES].copy_from_slice(&state.to_array());
    x[STATES..STATES + 3].copy_from_slice(&[
        controls.aileron,
        controls.elevator,
        controls.throttle,
    ]);
    x
}

/// Splits an array in the order of [`inputs`] into state and controls.
#[inline(always)]
pub(super) fn split<R: Copy>(x: [R; INPUTS]) -> (State<R>, Controls<R>) {
    let state = State::from_array([x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]]);
    let [aileron, elevator, throttle, rudder] = [x[8], x[9], x[10], x[11]];
    (state, Controls { aileron, elevator, throttle, rudder, lagged: None })
}

/// Splits the Jacobian into its columns for the states and its columns for the controls.
pub(super) fn matrices(
    rows: [[f64; INPUTS]; STATES],
) -> (SMatrix<f64, STATES, STATES>, SMatrix<f64, STATES, 4>) {
    (SMatrix::from_fn(|i, j| rows[i][j]), SMatrix::from_fn(|i, j| rows[i][STATES + j]))
}
