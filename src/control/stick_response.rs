//! Step responses of a model to aileron and elevator from steady straight flight.

use greylag_model::{GreyBox, Trim, TrimError};
use greylag_physics::{Controls, State};

/// Step size as a fraction of the surface's smaller travel.
pub const STEPPED: f64 = 0.25;
/// Simulated time after the step, s.
const FLOWN_S: f64 = 3.0;
/// Integration step, s.
const STEP_S: f64 = 0.005;

/// Response of a model to a step of one surface.
#[derive(Clone, Debug, Default)]
pub struct StickResponse {
    /// Times since the step, s.
    pub time_s: Vec<f64>,
    /// States at these times.
    pub states: Vec<State>,
}

/// Computes the response to a quarter of full aileron (roll right), then that to a quarter of full elevator (nose up). Both
/// start from straight flight at the cruise airspeed. The surfaces move without delay.
///
/// # Errors
///
/// If the model has no straight-flight trim at the cruise airspeed.
pub fn stick_responses(model: &GreyBox) -> Result<[StickResponse; 2], TrimError> {
    let altitude = model.airframe.reference.altitude;
    let trim = Trim::straight(model, model.airframe.envelope.airspeed_cruise_mps, altitude)?;
    let figures = &model.airframe.actuators;
    let aileron = STEPPED * figures.aileron.travel.smallest();
    let elevator = STEPPED * figures.elevator.travel.smallest();
    let held = trim.controls;
    Ok([
        flown(model, trim.state, Controls { aileron: held.aileron + aileron, ..held }, altitude),
        flown(model, trim.state, Controls { elevator: held.elevator - elevator, ..held }, altitude),
    ])
}

/// States after a step to `controls`, by the classical Runge–Kutta method. The response ends at a state that is not finite.
fn flown(model: &GreyBox, from: State, controls: Controls, altitude: f64) -> StickResponse {
    let rate = |x: [f64; 8]| model.rate(&State::from_array(x), &controls, altitude).to_array();
    let along = |x: [f64; 8], k: [f64; 8], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    let mut x = from.to_array();
    let mut response = StickResponse::default();
    for i in 0..=(FLOWN_S / STEP_S) as usize {
        response.time_s.push(i as f64 * STEP_S);
        response.states.push(State::from_array(x));
        let a = rate(x);
        let b = rate(along(x, a, 0.5 * STEP_S));
        let c = rate(along(x, b, 0.5 * STEP_S));
        let d = rate(along(x, c, STEP_S));
        x = std::array::from_fn(|i| x[i] + STEP_S / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
        if x.iter().any(|v| !v.is_finite()) {
            break;
        }
    }
    response
}
