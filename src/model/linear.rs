//! The linear model about a flight condition, with exact derivatives.

use nalgebra::SMatrix;

use super::{GreyBox, Memory, Trim};
use greylag_num::Dual;
use greylag_physics::{Controls, State};

/// Linear model of one step of 0.01 s about a condition: δs₊ = a δs + b δz, z = (δa, δe, δt, δr).
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Jacobian ∂s₊/∂s, states in the order of eq. (4).
    pub a: SMatrix<f64, 8, 8>,
    /// Jacobian ∂s₊/∂(δa, δe, δt, δr).
    pub b: SMatrix<f64, 8, 4>,
}

/// Linearises one step of `model` about `trim` at `altitude` (m).
///
/// The integrator's memory is taken as steady: its last acceleration equals the present one. The controls are those
/// that act; the model's input effects (lag, delay, dead zone) are left out, since they have their own memory.
pub fn linearise(model: &GreyBox, trim: &Trim, altitude: f64) -> Linear {
    linearise_step(model, &trim.state, &trim.controls, altitude)
}

/// Linearises one step about any state, steady or not.
pub fn linearise_step(
    model: &GreyBox,
    state: &State,
    controls: &Controls,
    altitude: f64,
) -> Linear {
    let x = state.to_array();
    let z = [controls.aileron, controls.elevator, controls.throttle, controls.rudder];
    let state = State::from_array(std::array::from_fn(|i| Dual::<12>::variable(x[i], i)));
    let [aileron, elevator, throttle, rudder] =
        std::array::from_fn(|i| Dual::variable(z[i], 8 + i));
    let controls = Controls { aileron, elevator, throttle, rudder, lagged: None };
    let next = model.step(&state, &controls, altitude, &mut Memory::default()).to_array();
    Linear {
        a: SMatrix::from_fn(|i, j| next[i].gradient[j]),
        b: SMatrix::from_fn(|i, j| next[i].gradient[8 + j]),
    }
}
