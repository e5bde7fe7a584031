//! Estimates the disturbance: the part of the state's rate of change that the model does not explain. A planner adds the
//! estimate to its model and keeps it constant over a plan.
//!
//! The method is offset-free model predictive control (Pannocchia and Rawlings, AIChE J. 49, 2003) with the disturbance on
//! the states. If the aircraft flies steadily, the planner's model with the disturbance is steady too, whatever the model error.

use crate::Observation;
use greylag_model::{GreyBox, Memory, STEP};
use greylag_physics::actuators::Actuators;
use greylag_physics::inputs::InputMemory;
use greylag_physics::{Controls, State};

/// The zero disturbance.
pub(crate) const NONE: State =
    State { roll: 0.0, pitch: 0.0, airspeed: 0.0, p: 0.0, q: 0.0, r: 0.0, alpha: 0.0, beta: 0.0 };

/// Default time constant of the estimate, s. With a shorter time constant the estimate follows the noise. With a longer one
/// it lags behind manoeuvres.
pub(crate) const TIME_CONSTANT_S: f64 = 0.3;
/// Default limit of the ratio of prediction error to measured motion, both as root mean squares over about half a second. A
/// model above the limit is not used for planning, unless the errors look like gusts ([`SLOPE`]). In still air, planning was
/// always possible with `params/x8/learned` and almost never with `prior-as-printed`, whose inertia has the wrong sign
/// (`results/notes/2026-11-27-learned-models.md`).
pub(crate) const TRUST: f64 = 0.5;
/// Averaging time of the squares of prediction errors and of measured changes, s: a few periods of the short-period mode.
const MEMORY_S: f64 = 0.5;
/// Averaging time of the regression of prediction errors on predictions, s. Gusts average out over this time.
const SLOPE_MEMORY_S: f64 = 2.0;
/// Largest accepted magnitude of the regression slope of the prediction error on the predicted change. With a larger slope
/// the model is rejected. The slope is near 0 in gusts, and −1 if the predicted change did not happen at all.
/// `docs/validation/controllers.md` has values in turbulence for right and wrong models.
const SLOPE: f64 = 0.7;
/// Rate of change whose square is added to the mean squares of the measured and of the predicted change before the errors are
/// divided by them, in x_c per second. Without it, small errors in calm flight would count as large. x_c is the characteristic
/// scale of a state (eq. 21 of \[GSFM26\], see `src/lib.rs`).
const CALM: f64 = 0.02;

/// Prediction error that counts as the model's, in standard deviations of the error that inexact flow angles cause. Beside flight
/// controllers without vanes in light turbulence the right model is then never rejected, and `prior-as-printed` nearly always
/// (`results/notes/2026-11-30-angle-of-attack-in-turbulence.md`).
const BEYOND_FLOW: f64 = 2.0;
/// Shortest and longest time between two states for a prediction, in steps. Flight controllers send states by their own loop:
/// ArduPlane at 250 Hz alternates between 8 and 12 ms, a stream of 50 Hz has 20 ms.
const GAPS: [f64; 2] = [0.3, 3.0];
/// Largest deviation of the time between two states from its mean, as a fraction of the mean, with which they are used. Around lost
/// and reordered states the parts of a state are of different times.
const IRREGULAR: f64 = 0.4;
/// Averaging time of the time between two states, s.
const PACE_S: f64 = 0.5;
/// Prediction error of one step above which the difference is a jump of a sensor and not a motion. In severe turbulence of
/// MIL-F-8785C (6.4 m/s, 530 m, at 20 m/s) two standard deviations of a step are 0.02 rad of the flow angles and 0.4 m/s. The other
/// values are far above what forces and moments change in 10 ms: 10 rad/s of attitude and 200 rad/s².
const JUMP: State =
    State { roll: 0.1, pitch: 0.1, airspeed: 3.0, p: 2.0, q: 2.0, r: 2.0, alpha: 0.05, beta: 0.05 };

/// Recursive estimator of the disturbance and of the model's prediction error.
#[derive(Clone, Debug)]
pub(crate) struct Disturbance {
    /// Time constant of the estimate, s.
    time_constant: f64,
    last: Option<Observation>,
    /// Mean time between two states, steps.
    pace: f64,
    memory: Memory,
    /// Memory of the model's input effects and lags. `None` before the first prediction and after a gap: the controls are then
    /// taken to be at rest.
    inputs: Option<InputMemory>,
    rate: State,
    /// Mean squares over [`MEMORY_S`] of the prediction error and of the measured state change, (x_c per second)².
    missed: f64,
    happened: f64,
    /// Mean square over [`MEMORY_S`] of the prediction error that inexact flow angles cause, (x_c per second)².
    flow: f64,
    /// Means over [`SLOPE_MEMORY_S`] of the prediction error times the predicted change, and of the squared predicted change.
    /// Both are sums over p, q and r.
    slope: [f64; 2],
}

impl Disturbance {
    /// A zero estimate with time constant `time_constant` (s).
    pub fn new(time_constant: f64) -> Disturbance {
        let (missed, happened, flow, slope) = (0.0, 0.0, 0.0, [0.0; 2]);
        Disturbance {
            time_constant,
            last: None,
            pace: 1.0,
            memory: Memory::default(),
            inputs: None,
            rate: NONE,
            missed,
            happened,
            flow,
            slope,
        }
    }

    /// Updates the estimates with the difference between `seen` and the model's prediction from the last tick. After a gap
    /// or an irregular time between ticks, and with values that are not finite, the estimates do not change. A jump of a sensor sets the disturbance
    /// to zero.
    pub fn update(&mut self, model: &GreyBox, seen: &Observation) {
        let last = self.last.replace(*seen);
        let Some((last, steps)) = last.and_then(|last| Some((last, self.steps_since(&last)?)))
        else {
            (self.memory, self.inputs) = (Memory::default(), None);
            return;
        };
        let figures = &model.airframe.actuators;
        let measured =
            Actuators::from_observed(&last.actuators, &last.previous, figures).controls();
        let inputs = self.inputs.get_or_insert_with(|| model.at_rest(&measured));
        let mut controls = model.act(&measured, inputs);
        for _ in 1..steps.round() as usize {
            controls = model.act(&measured, inputs);
        }
        let expected = model.step(&last.state, &controls, last.altitude, &mut self.memory);
        let predicted = change(&last.state, &expected);
        // all changes are those of one step
        let happened = NONE.advance(&change(&last.state, &seen.state), 1.0 / steps);
        let error = happened.advance(&predicted, -1.0);
        let flow = from_flow(model, &last, &controls);
        self.compare(model, steps * STEP, [&error.advance(&self.rate, -STEP), &happened], flow);
        if is_jump(&NONE.advance(&error, steps)) {
            // the estimate up to now was of the other reading
            self.rate = NONE;
            return;
        }
        let part = (steps * STEP / self.time_constant).min(1.0);
        let moved = self.rate.advance(&self.rate, -part).advance(&error, part / STEP);
        if moved.is_finite() {
            self.rate = moved;
        } else {
            (self.memory, self.inputs) = (Memory::default(), None);
        }
    }

    /// Time from `last` to the newest state, in steps. `None` if it is too short, too long or irregular.
    fn steps_since(&mut self, last: &Observation) -> Option<f64> {
        let steps = self.last?.time.since(last.time).as_secs_f64() / STEP;
        if !(GAPS[0]..=GAPS[1]).contains(&steps) {
            return None;
        }
        let regular = (steps - self.pace).abs() <= IRREGULAR * self.pace;
        self.pace += steps * STEP / PACE_S * (steps - self.pace);
        regular.then_some(steps)
    }

    /// Updates the error statistics with the prediction error `missed` and the measured change `happened` of one step, after the
    /// time `passed` (s). `flow` is the mean square that inexact flow angles cause, (x_c per second)².
    fn compare(
        &mut self,
        model: &GreyBox,
        passed: f64,
        [missed, happened]: [&State; 2],
        flow: f64,
    ) {
        // only p, q, r, α and β are compared, in x_c per second; attitude and airspeed are not
        let scale = model.scale();
        let scaled = |change: &State| -> [f64; 5] {
            let change = change.to_array();
            std::array::from_fn(|i| change[i + 3] / scale[i + 3] / STEP)
        };
        let (missed, happened) = (scaled(missed), scaled(happened));
        let square = |x: &[f64]| -> f64 { x.iter().map(|x| x * x).sum() };
        // the slope excludes flow angles: a gust changes them immediately, but it changes the body rates only through moments
        let predicted: [f64; 3] = std::array::from_fn(|i| happened[i] - missed[i]);
        let product: f64 = missed.iter().zip(predicted).map(|(m, p)| m * p).sum();
        let means = [square(&missed), square(&happened), flow, product, square(&predicted)];
        if !means.iter().all(|x| x.is_finite()) {
            return;
        }
        let [missed, happened, flow, product, predicted] = means;
        let follow =
            |mean: &mut f64, x: f64, time: f64| *mean += (passed / time).min(1.0) * (x - *mean);
        follow(&mut self.missed, missed, MEMORY_S);
        follow(&mut self.happened, happened, MEMORY_S);
        follow(&mut self.flow, flow, MEMORY_S);
        follow(&mut self.slope[0], product, SLOPE_MEMORY_S);
        follow(&mut self.slope[1], predicted, SLOPE_MEMORY_S);
    }

    /// Whether planning must not use the model. The result is true if two conditions hold: the root-mean-square prediction error
    /// of the last half second, less what inexact flow angles cause, exceeds the fraction `most` of the measured motion, and the
    /// error is correlated with the predicted change. The second condition excludes gusts, which no model predicts.
    pub fn is_wrong(&self, most: f64) -> bool {
        let missed = (self.missed - BEYOND_FLOW * BEYOND_FLOW * self.flow).max(0.0);
        let part = (missed / (self.happened + CALM * CALM)).sqrt();
        let [product, predicted] = self.slope;
        part > most && (product / (predicted + CALM * CALM)).abs() > SLOPE
    }

    /// Estimated disturbance, which is added to the model's state rate, in units of the state per second.
    pub fn rate(&self) -> State {
        self.rate
    }

    /// Memory of the model's integrator at the last step.
    pub fn memory(&self) -> Memory {
        self.memory
    }
}

/// Mean square of the prediction error of p, q, r, α and β, (x_c per second)², that the standard deviations of the flow angles in
/// `seen` cause.
fn from_flow(model: &GreyBox, seen: &Observation, controls: &Controls) -> f64 {
    // without this every planner and simulation would evaluate the model three times more a step
    if seen.incidence_sd == [0.0; 2] {
        return 0.0;
    }
    let scale = model.scale();
    let rate = |state: &State| model.rate(state, controls, seen.altitude);
    let base = rate(&seen.state);
    let caused = |change: State| {
        let moved = rate(&seen.state.advance(&change, 1.0)).advance(&base, -1.0).to_array();
        (3..8).map(|i| (moved[i] / scale[i]).powi(2)).sum::<f64>()
    };
    let [alpha, beta] = seen.incidence_sd;
    caused(State { alpha, ..NONE }) + caused(State { beta, ..NONE })
}

/// The change from `from` to `to`, with the change of the roll angle in −π..π.
fn change(from: &State, to: &State) -> State {
    use std::f64::consts::{PI, TAU};
    let change = to.advance(from, -1.0);
    State { roll: (change.roll + PI).rem_euclid(TAU) - PI, ..change }
}

/// Whether the prediction error `error` of one step exceeds [`JUMP`] in any state.
fn is_jump(error: &State) -> bool {
    error.to_array().into_iter().zip(JUMP.to_array()).any(|(error, most)| error.abs() > most)
}

#[cfg(test)]
mod tests;
