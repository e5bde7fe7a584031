//! One-step prediction errors of a model over a simulated flight in which all controls are excited.

use super::{Environment, Trouble};
use greylag_control::{ControllerKind, Observation, SetupError, Target, build};
use greylag_model::{GreyBox, Memory, STEP};
use greylag_physics::Command;

/// Angular frequencies of the sines on aileron, elevator, throttle and rudder, rad per step.
const WAVES: [f64; 4] = [0.11, 0.13, 0.05, 0.07];

/// A flight in which an LQI designed from the model holds attitudes. A sine is added to each of its commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Length in steps of 0.01 s.
    pub steps: usize,
    /// Number of steps with sines, from the start of the flight.
    pub moved: usize,
    /// Amplitude of the sine on each control, in units of its command.
    pub amplitude: Command,
}

/// One-step prediction errors of the model in a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// RMS error of the predicted state changes over the flight, divided by the step and by the state's scale x_c, 1/s. The
    /// order is that of `State::to_array`.
    pub rms: [f64; 8],
    /// Observation after the last step.
    pub last: Observation,
}

impl Errors {
    /// The index and the value of the largest of [`Errors::rms`].
    pub fn worst(&self) -> (usize, f64) {
        let largest = self.rms.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        largest.unwrap_or_default()
    }
}

/// Reason why the flight failed.
#[derive(Debug, thiserror::Error)]
pub enum FlightError {
    /// No LQI can be designed from the model.
    #[error(transparent)]
    Controller(#[from] SetupError),
    /// The environment cannot continue.
    #[error(transparent)]
    Trouble(#[from] Trouble),
}

/// Flies `flight` in `environment` towards the `target` of each step. For each step, `model` predicts the state after the step
/// from the state and the actuator positions before it.
///
/// # Errors
///
/// If no LQI can be designed from the model, or the environment cannot continue.
pub fn errors(
    model: &GreyBox,
    environment: &mut impl Environment,
    flight: &Flight,
    target: impl Fn(usize) -> Target,
) -> Result<Errors, FlightError> {
    let scale = model.scale();
    let mut lqi = build(ControllerKind::Lqi, model)?;
    lqi.reset(1);
    let mut seen = environment.reset()?;
    let (mut memory, mut squares) = (Memory::default(), [0.0; 8]);
    let mut inputs = model.at_rest(&seen.actuators.controls());
    for step in 0..flight.steps {
        let own = lqi.command(&seen, &target(step));
        let command = if step < flight.moved { moved(own, flight.amplitude, step) } else { own };
        let acting = model.act(&seen.actuators.controls(), &mut inputs);
        let expected = model.step(&seen.state, &acting, seen.altitude, &mut memory);
        seen = environment.step(command.clamped())?;
        let pairs = seen.state.to_array().into_iter().zip(expected.to_array());
        for ((sum, (flown, own)), scale) in squares.iter_mut().zip(pairs).zip(scale) {
            *sum += ((flown - own) / STEP / scale).powi(2);
        }
    }
    Ok(Errors { rms: squares.map(|sum| (sum / flight.steps as f64).sqrt()), last: seen })
}

/// `own` plus the sines at `step`.
fn moved(own: Command, amplitude: Command, step: usize) -> Command {
    let [aileron, elevator, throttle, rudder] =
        WAVES.map(|frequency| (frequency * step as f64).sin());
    Command {
        aileron: own.aileron + amplitude.aileron * aileron,
        elevator: own.elevator + amplitude.elevator * elevator,
        throttle: own.throttle + amplitude.throttle * throttle,
        rudder: own.rudder + amplitude.rudder * rudder,
    }
}
