//! One recurrent policy for all fixed-wing aircraft: a gated recurrent unit (GRU). It was trained with analytic gradients
//! through simulated flights of aircraft drawn from a distribution (`params/any/train.py`). Of the aircraft it is given the
//! cruise airspeed and whether there is a rudder. Its recurrent state adapts to all other properties in flight.

mod network;

use crate::{Controller, Observation, SetupError, Target};
use greylag_model::STEP;
use greylag_physics::atmosphere::STANDARD_GRAVITY;
use greylag_physics::{Airframe, Command};
use network::{HIDDEN, INPUTS, Network};

/// Largest roll and pitch rates of the reference attitude, rad/s. The reference attitude approaches the target with the time
/// constant `ROUNDING`, s. The policy was trained with both values (`params/any/train.py`). A change needs a new training.
const REFERENCE: [f64; 2] = [0.9, 0.5];
const ROUNDING: f64 = 0.35;
/// Largest magnitude of the integrals of the attitude errors, rad s.
const INTEGRAL_MOST: f64 = 0.5;
/// Largest magnitude of the integral of the airspeed error as a fraction of the cruise airspeed, s.
const SPEED_INTEGRAL_MOST: f64 = 2.0;

/// State of the policy between two steps.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Memory {
    hidden: [f64; HIDDEN],
    reference: Option<[f64; 2]>,
    integral: [f64; 2],
    speed_integral: f64,
}

const NOTHING: Memory =
    Memory { hidden: [0.0; HIDDEN], reference: None, integral: [0.0; 2], speed_integral: 0.0 };

/// The controller that flies the shipped policy for any aircraft.
#[derive(Clone, Debug)]
pub struct AnyPolicy {
    network: &'static Network,
    /// Cruise airspeed, m/s.
    cruise: f64,
    rudder: bool,
    memory: Memory,
}

impl AnyPolicy {
    /// The policy shipped with the program, for the aircraft described by `airframe`.
    ///
    /// # Errors
    /// If the shipped file lacks a tensor of the network, or a tensor has the wrong shape or a value that is not finite.
    pub fn new(airframe: &Airframe) -> Result<AnyPolicy, SetupError> {
        Ok(AnyPolicy {
            network: network::shipped()?,
            cruise: airframe.envelope.airspeed_cruise_mps,
            rudder: airframe.actuators.rudder.is_some(),
            memory: NOTHING,
        })
    }

    /// Inputs of the network in the order used in training, and the policy's state after this step. Reference attitude and
    /// integrals of that state are new, the recurrent state is unchanged.
    fn see(&self, seen: &Observation, target: &Target) -> ([f64; INPUTS], Memory) {
        let (s, u, mut memory) = (&seen.state, &seen.previous[0], self.memory);
        let time = self.cruise / STANDARD_GRAVITY;
        let speed = (s.airspeed / self.cruise).clamp(0.3, 3.0);
        let (now, wanted) = ([s.roll, s.pitch], [target.roll, target.pitch]);
        let mut reference = memory.reference.unwrap_or(now);
        let (mut rates, mut errors) = ([0.0; 2], [0.0; 2]);
        for k in 0..2 {
            rates[k] = ((wanted[k] - reference[k]) / ROUNDING).clamp(-REFERENCE[k], REFERENCE[k]);
            reference[k] += rates[k] * STEP;
            errors[k] = reference[k] - now[k];
            let grown = memory.integral[k] + errors[k] * STEP;
            memory.integral[k] = grown.clamp(-INTEGRAL_MOST, INTEGRAL_MOST);
        }
        memory.reference = Some(reference);
        memory.speed_integral = (memory.speed_integral + (1.0 - speed) * STEP)
            .clamp(-SPEED_INTEGRAL_MOST, SPEED_INTEGRAL_MOST);
        let (sin, cos) = s.roll.sin_cos();
        // yaw rate of a coordinated turn about the vertical, then its components about the body's y and z axes, rad/s
        let turn = s.roll.clamp(-1.2, 1.2).tan() * s.pitch.cos() / (speed * time);
        let [pull, swing] = [sin, cos].map(|part| turn * part * s.pitch.cos());
        let inputs = [
            4.0 * errors[0],
            8.0 * errors[1],
            rates[0],
            2.0 * rates[1],
            8.0 * memory.integral[0],
            8.0 * memory.integral[1],
            reference[0],
            2.0 * reference[1],
            sin,
            2.0 * s.pitch.sin(),
            0.5 * s.p,
            s.q,
            s.r,
            s.q - pull,
            s.r - swing,
            4.0 * (speed - 1.0),
            memory.speed_integral,
            u.aileron,
            u.elevator,
            u.throttle,
            u.rudder,
            time.ln(),
            f64::from(self.rudder),
            1.0,
        ];
        (inputs, memory)
    }
}

impl Controller for AnyPolicy {
    fn name(&self) -> &'static str {
        "any"
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, _seed: u64) {
        self.memory = NOTHING;
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        let (inputs, mut memory) = self.see(seen, target);
        let [aileron, elevator, throttle, rudder] = self.network.step(&mut memory.hidden, &inputs);
        // a NaN among the inputs gives a NaN command but must not enter the recurrent state
        if inputs.iter().all(|x| x.is_finite()) {
            self.memory = memory;
        }
        let rudder = if self.rudder { rudder } else { 0.0 };
        Command { aileron, elevator, throttle: 0.5 + 0.5 * throttle, rudder }
    }
}
