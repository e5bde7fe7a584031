//! Adaptive attitude hold for an aircraft without a model. The gains of its cascaded loops are divided by control powers
//! that are estimated in flight. The controller needs two facts: the cruise airspeed, and whether the aircraft has a rudder.
//!
//! Control power is the angular acceleration at full deflection. The priors, the lift slope and the gains of throttle and
//! rudder are in units of V/g, where V is the cruise airspeed (Froude scaling). One set of constants therefore serves small
//! models and light aircraft. The means of the priors are medians over a distribution of aircraft (`greylag aircraft draw`),
//! except the mean of the roll control power. The gains were tuned on aircraft drawn from this distribution
//! (`docs/validation/any-aircraft.md`).

mod estimate;

use crate::{Controller, Observation, Target};
use estimate::{Estimate, Prior, Seen};
use greylag_model::STEP;
use greylag_physics::atmosphere::STANDARD_GRAVITY;
use greylag_physics::{Airframe, Command};

/// Prior of control power, damping and stiffness of the roll axis, in the units of [`Prior`]. The mean of the control power is
/// twice the median of the distribution, because a loop gain that is too low costs less than one that is too high.
const ROLL: Prior = Prior { mean: [400.0, 15.0, 0.0], sd: [250.0, 10.0, 1e-6], least: 25.0 };
/// Prior of control power, damping and stiffness of the pitch axis, in the units of [`Prior`].
const PITCH: Prior = Prior { mean: [300.0, 10.0, 40.0], sd: [200.0, 7.0, 50.0], least: 10.0 };
/// Lift slope −Z_α at cruise, in g/V. In this unit it is about CLα / CL, which differs little between aircraft.
const LIFT_SLOPE: f64 = 9.0;

/// Gains from the roll error to the commanded roll rate and from the pitch error to the commanded pitch rate, 1/s.
const ATTITUDE: [f64; 2] = [3.0, 2.4];
/// Bandwidth of the rate loops, 1/s.
const RATE: f64 = 6.0;
/// Ratio of the integral gain to the proportional gain of the rate loops, 1/s.
const INTEGRAL: f64 = 3.5;
/// Largest magnitude of the integral's part of the command, where 1 is full travel.
const INTEGRAL_MOST: f64 = 0.8;
/// Fraction of the estimated pitch stiffness that the feed-forward of the elevator uses.
const STIFFNESS_SHARE: f64 = 0.7;
/// Largest roll and pitch rates of the reference attitude, rad/s. The reference is the commanded attitude after a rate limit and
/// a first-order lag with the time constant `ROUNDING`, s.
const REFERENCE: [f64; 2] = [0.9, 0.5];
const ROUNDING: f64 = 0.35;

/// Coefficients of the throttle law: throttle at cruise (0..1), gain on the relative airspeed error, gain on the time
/// integral of this error (time in units of V/g), gain on the sine of the pitch angle.
const THROTTLE: [f64; 4] = [0.4, 1.5, 0.8, 1.2];
/// Airspeeds as fractions of the cruise airspeed. Below the first, the nose is lowered progressively. At the second, it is
/// [`NOSE_DOWN`] (rad) below the horizon.
const SLOW: [f64; 2] = [0.80, 0.65];
const NOSE_DOWN: f64 = 0.15;
/// Gain of the rudder command on the yaw rate minus the yaw rate of a coordinated turn, in V/g. `RUDDER_MOST` is the largest
/// magnitude of the rudder command.
const YAW_DAMPING: f64 = 0.25;
const RUDDER_MOST: f64 = 0.5;

/// Estimated properties of the aircraft at its cruise airspeed. The control powers are effective values over about a tenth of a
/// second. A slow servo or a delay reduces them below the aerodynamic values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    /// Roll acceleration at full aileron, rad/s².
    pub roll_power: f64,
    /// Roll damping −L_p: rate of decay of the roll rate, 1/s.
    pub roll_damping: f64,
    /// Pitch acceleration at full elevator, rad/s².
    pub pitch_power: f64,
    /// Pitch damping −M_q: rate of decay of the pitch rate at a constant angle of attack, 1/s.
    pub pitch_damping: f64,
    /// Pitch stiffness −M_α: nose-down pitch acceleration per angle of attack, 1/s².
    pub pitch_stiffness: f64,
}

/// Estimate of one axis, and the integral of its rate loop as a part of the command.
#[derive(Clone, Debug)]
struct Axis {
    estimate: Estimate,
    integral: f64,
}

impl Axis {
    fn new(prior: Prior) -> Axis {
        Axis { estimate: Estimate::new(prior), integral: 0.0 }
    }

    /// Computes the command (−1..1) that drives the body rate `rate` to its setpoint `wanted` (rad/s). `feed` maps damping (1/s)
    /// and stiffness (1/s²) to the acceleration (rad/s²) that is needed to hold the setpoint. `speed` and `time` are those of
    /// [`Seen`].
    fn command(
        &mut self,
        [rate, wanted]: [f64; 2],
        [speed, time]: [f64; 2],
        feed: impl Fn(f64, f64) -> f64,
    ) -> f64 {
        let [power, damping, stiffness] = self.estimate.theta;
        let power = power * (speed / time).powi(2);
        let damping = damping.clamp(0.0, 60.0) * speed / time;
        let stiffness = stiffness.clamp(-20.0, 200.0) * (speed / time).powi(2);
        let push = RATE * (wanted - rate) / power;
        let raw = push + feed(damping, stiffness) / power + self.integral;
        let grown = INTEGRAL * push * STEP;
        // conditional integration: the integral does not wind up while the command is saturated
        let outward = (raw > 1.0 && grown > 0.0) || (raw < -1.0 && grown < 0.0);
        if !outward && grown.is_finite() {
            self.integral = (self.integral + grown).clamp(-INTEGRAL_MOST, INTEGRAL_MOST);
        }
        raw.clamp(-1.0, 1.0)
    }
}

/// The adaptive attitude controller of one aircraft.
#[derive(Clone, Debug)]
pub struct Adaptive {
    /// Cruise airspeed of the aircraft, m/s.
    cruise: f64,
    rudder: bool,
    reference: Option<[f64; 2]>,
    axes: [Axis; 2],
    /// Estimated deviation of the angle of attack from that of steady flight, rad.
    incidence: f64,
    thrust: f64,
}

impl Adaptive {
    /// A controller for the aircraft of `airframe`. Only its cruise airspeed and the presence of a rudder are used.
    pub fn new(airframe: &Airframe) -> Adaptive {
        Adaptive {
            cruise: airframe.envelope.airspeed_cruise_mps,
            rudder: airframe.actuators.rudder.is_some(),
            reference: None,
            axes: [ROLL, PITCH].map(Axis::new),
            incidence: 0.0,
            thrust: 0.0,
        }
    }

    /// The present estimate of the aircraft's properties.
    pub fn belief(&self) -> Belief {
        let time = self.cruise / STANDARD_GRAVITY;
        let [roll, pitch] = [0, 1].map(|k| self.axes[k].estimate.theta);
        Belief {
            roll_power: roll[0] / (time * time),
            roll_damping: roll[1] / time,
            pitch_power: pitch[0] / (time * time),
            pitch_damping: pitch[1] / time,
            pitch_stiffness: pitch[2] / (time * time),
        }
    }

    /// Moves the reference towards the setpoint `wanted` (roll and pitch, rad). Returns the reference (rad) and its rates
    /// (rad/s). The reference starts at the attitude `now`.
    fn follow(&mut self, now: [f64; 2], wanted: [f64; 2]) -> [[f64; 2]; 2] {
        let mut reference = self.reference.unwrap_or(now);
        let mut rates = [0.0; 2];
        for k in 0..2 {
            let rate = ((wanted[k] - reference[k]) / ROUNDING).clamp(-REFERENCE[k], REFERENCE[k]);
            if rate.is_finite() {
                rates[k] = rate;
                reference[k] += rate * STEP;
            }
        }
        // a reference that is not finite is discarded: the next tick starts again at the attitude of that tick
        self.reference = Some(reference).filter(|x| x.iter().all(|x| x.is_finite()));
        [reference, rates]
    }

    fn throttle(&mut self, speed: f64, time: f64, pitch: f64) -> f64 {
        let [level, proportional, integral, climb] = THROTTLE;
        let missing = 1.0 - speed;
        let raw = level + proportional * missing + self.thrust + climb * pitch.sin();
        let outward = (raw > 1.0 && missing > 0.0) || (raw < 0.0 && missing < 0.0);
        if !outward && missing.is_finite() {
            self.thrust = (self.thrust + integral * missing * STEP / time).clamp(-0.6, 0.8);
        }
        raw.clamp(0.0, 1.0)
    }
}

/// The setpoints of roll and pitch (rad) that the reference follows. At low airspeed the nose is lowered and the bank is reduced,
/// see `SLOW`. `speed` is the airspeed divided by the cruise airspeed.
fn wanted(target: &Target, speed: f64) -> [f64; 2] {
    let slow = ((SLOW[0] - speed) / (SLOW[0] - SLOW[1])).clamp(0.0, 1.0);
    let lower = target.pitch * (1.0 - slow) - slow * NOSE_DOWN;
    let pitch = if slow > 0.0 { target.pitch.min(lower) } else { target.pitch };
    [target.roll * (1.0 - 0.5 * slow), pitch]
}

impl Controller for Adaptive {
    fn name(&self) -> &'static str {
        "adaptive"
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, _seed: u64) {
        self.reference = None;
        self.axes = [ROLL, PITCH].map(Axis::new);
        (self.incidence, self.thrust) = (0.0, 0.0);
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        let (state, before) = (&seen.state, &seen.previous[0]);
        let time = self.cruise / STANDARD_GRAVITY;
        let speed = (state.airspeed / self.cruise).clamp(0.3, 3.0);
        let (sin, cos) = state.roll.sin_cos();
        let level = state.pitch.cos();
        // rate of heading in a coordinated turn, rad/s
        let turn = state.roll.clamp(-1.2, 1.2).tan() * level / (speed * time);
        let slope = LIFT_SLOPE * speed / time;
        let pull = turn * sin * level;
        if state.q.is_finite() && pull.is_finite() {
            self.incidence += STEP * (state.q - pull - slope * self.incidence);
        }
        let seen_of = |rate: f64, command: f64, incidence: f64| Seen {
            rate,
            command,
            incidence,
            speed,
            time,
        };
        self.axes[0].estimate.see(&seen_of(state.p, before.aileron, 0.0));
        self.axes[1].estimate.see(&seen_of(state.q, -before.elevator, self.incidence));

        // a target airspeed below cruise is raised to cruise, because the stall speed is unknown
        let asked = state.airspeed / target.airspeed.max(self.cruise);
        let wanted = wanted(target, speed);
        let [reference, rates] = self.follow([state.roll, state.pitch], wanted);
        let roll = rates[0] - state.pitch.sin() * turn + ATTITUDE[0] * (reference[0] - state.roll);
        let climb = rates[1] + ATTITUDE[1] * (reference[1] - state.pitch);
        let pitch = climb * cos + pull;
        let scale = [speed, time];
        let aileron = self.axes[0].command([state.p, roll], scale, |damping, _| damping * roll);
        let up = self.axes[1].command([state.q, pitch], scale, |damping, stiffness| {
            damping * pitch + STIFFNESS_SHARE * stiffness * (pitch - pull) / slope
        });
        let throttle = self.throttle(asked, time, reference[1]);
        let skid = state.r - turn * cos * level;
        let rudder = (YAW_DAMPING * time * skid).clamp(-RUDDER_MOST, RUDDER_MOST);
        Command { aileron, elevator: -up, throttle, rudder: if self.rudder { rudder } else { 0.0 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_model::GreyBox;
    use greylag_physics::{ActuatorState, State, Time};
    use std::path::Path;

    #[test]
    fn an_attitude_that_is_unknown_at_first_does_not_stay_in_the_reference() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        let model = GreyBox::load(&path).unwrap();
        let mut controller = Adaptive::new(&model.airframe);
        let seen = |roll: f64| Observation {
            time: Time::default(),
            state: State { roll, ..State::NEUTRAL },
            incidence_sd: [0.0; 2],
            actuators: ActuatorState::default(),
            altitude: 600.0,
            previous: [Command::IDLE; 2],
        };
        let target = Target { roll: 0.5, pitch: 0.1, airspeed: 16.67 };
        assert!(!controller.command(&seen(f64::NAN), &target).is_finite());
        assert!(controller.command(&seen(0.1), &target).is_finite());
    }
}
