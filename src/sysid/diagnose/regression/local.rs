//! Residual (measured minus predicted forces and moments) at one sample, with its derivatives with respect to measured
//! quantities.

use crate::flight_path::reconstruction::Instant;
use crate::weak_form::windows::{gyroscopic, to_force_axes};
use greylag_model::GreyBox;
use greylag_num::{Dual, Real};
use greylag_physics::rigid_body;
use greylag_physics::{Channel, Controls, State};

/// Number of channels: D, L, Y (N), l, m, n (N m).
pub const CHANNELS: usize = 6;
/// Number of inputs: p, q, r, α, β, V, then aileron, elevator, throttle, rudder.
pub const INPUTS: usize = 10;
/// Index of the first body rate among the inputs.
pub const RATES: usize = 0;
/// Index of the angle of attack among the inputs; sideslip and airspeed follow.
pub const ALPHA: usize = 3;
/// Index of the aileron among the inputs; elevator, throttle and rudder follow.
pub const CONTROLS: usize = 6;

/// Residual at one sample. The moment that causes the angular acceleration is not included; it is computed later from the body
/// rates.
#[derive(Clone, Copy, Debug)]
pub struct Local {
    /// The residual, N or N m. Forces are NaN if the log has no specific force.
    pub value: [f64; CHANNELS],
    /// Derivatives of the residual with respect to the inputs, in their order.
    pub slope: [[f64; CHANNELS]; INPUTS],
}

/// Computes the residual of `model` and its derivatives at the sample `at` with the deflections `controls`.
pub fn local(model: &GreyBox, at: &Instant, controls: &Controls) -> Local {
    type D = Dual<INPUTS>;
    let s = &at.state;
    let state = State {
        roll: D::from_f64(s.roll),
        pitch: D::from_f64(s.pitch),
        airspeed: D::variable(s.airspeed, ALPHA + 2),
        p: D::variable(s.p, RATES),
        q: D::variable(s.q, RATES + 1),
        r: D::variable(s.r, RATES + 2),
        alpha: D::variable(s.alpha, ALPHA),
        beta: D::variable(s.beta, ALPHA + 1),
    };
    let controls = Controls {
        aileron: D::variable(controls.aileron, CONTROLS),
        elevator: D::variable(controls.elevator, CONTROLS + 1),
        throttle: D::variable(controls.throttle, CONTROLS + 2),
        rudder: D::variable(controls.rudder, CONTROLS + 3),
        lagged: controls.lagged.map(|lagged| lagged.map(D::from_f64)),
    };
    let all = residual(model, &state, &controls, at);
    Local {
        value: all.map(|x| x.value),
        slope: std::array::from_fn(|i| {
            std::array::from_fn(|k| {
                let slope = all[k].gradient[i];
                if slope.is_finite() { slope } else { 0.0 }
            })
        }),
    }
}

fn residual<R: Real>(
    model: &GreyBox,
    state: &State<R>,
    controls: &Controls<R>,
    at: &Instant,
) -> [R; CHANNELS] {
    let air = model.air(state, at.altitude);
    let wrench = model.wrench(state, controls, &air);
    let measured = at.specific_force.map(|f| R::from_f64(f * model.body.mass));
    let predicted = rigid_body::body_force(&wrench, &air, model.axes);
    let left = std::array::from_fn(|k| measured[k] - predicted[k]);
    let [drag, lift, side] = to_force_axes(left, &air, model.axes);
    let turning = gyroscopic(&model.body, state);
    let [roll, pitch, yaw] = [Channel::Roll, Channel::Pitch, Channel::Yaw].map(|c| wrench.get(c));
    [drag, lift, side, turning[0] - roll, turning[1] - pitch, turning[2] - yaw]
}
