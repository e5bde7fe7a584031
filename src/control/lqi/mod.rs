//! LQI: linear-quadratic attitude control with integral action, scheduled over the envelope.

mod design;
mod riccati;
mod schedule;

use std::sync::Arc;

use nalgebra::SVector;

use crate::control::{Controller, Observation, SetupError, Target};
use crate::model::{GreyBox, STEP};
use crate::physics::Command;
use design::STATES;
use schedule::Schedule;

/// Largest rates of the reference, rad/s: commanded steps become ramps that the surfaces can
/// follow, so the integrators never see a large error.
const ROLL_RATE: f64 = 0.8;
const PITCH_RATE: f64 = 0.5;
/// Time constant that rounds the ramps' ends, s.
const ROUNDING: f64 = 0.35;
/// Incidence (rad, 9.2°) beyond which the nose is pushed down, and by how much elevator (rad) a rad.
const STALL_ALPHA: f64 = 0.16;
const STALL_GAIN: f64 = 3.0;
/// Airspeed loop: per m/s, and per m.
const AIRSPEED_KP: f64 = 0.3;
const AIRSPEED_KI: f64 = 0.05;

/// The gain-scheduled LQI, designed from any model.
#[derive(Clone, Debug)]
pub struct Lqi {
    schedule: Arc<Schedule>,
    deflection: f64,
    reference: Option<[f64; 2]>,
    integral: [f64; 2],
    airspeed_integral: f64,
}

impl Lqi {
    /// Designs the controller for `model` over 12..50 m/s, ±60° of roll and ±30° of pitch.
    ///
    /// The margins before the stall and the airspeed loop are those of the X8.
    ///
    /// # Errors
    /// If the model cannot be trimmed or stabilised at some attitude at any airspeed.
    pub fn new(model: &GreyBox) -> Result<Lqi, SetupError> {
        Ok(Lqi {
            schedule: Arc::new(Schedule::new(model)?),
            deflection: model.airframe.actuators.deflection_max,
            reference: None,
            integral: [0.0; 2],
            airspeed_integral: 0.0,
        })
    }

    /// Moves the reference towards the target, and returns it.
    fn follow(&mut self, seen: &Observation, target: &Target) -> [f64; 2] {
        let mut reference = self.reference.unwrap_or([seen.state.roll, seen.state.pitch]);
        // too slow for the bank asked for: bank as far as the airspeed allows, and more with it
        let part = self.schedule.tolerable_part(seen.state.airspeed, target.roll, target.pitch);
        let wanted = [part * target.roll, target.pitch];
        for ((x, wanted), rate) in reference.iter_mut().zip(wanted).zip([ROLL_RATE, PITCH_RATE]) {
            let step = ((wanted - *x) / ROUNDING).clamp(-rate, rate) * STEP;
            if step.is_finite() {
                *x += step;
            }
        }
        self.reference = Some(reference);
        reference
    }

    fn throttle(&mut self, seen: &Observation, target: &Target, feed_forward: f64) -> f64 {
        let wanted =
            self.schedule.comfortable_airspeed(target.roll, target.pitch).max(target.airspeed);
        let error = wanted - seen.state.airspeed;
        let raw = feed_forward + AIRSPEED_KP * error + self.airspeed_integral;
        let outward = (raw > 1.0 && error > 0.0) || (raw < 0.0 && error < 0.0);
        if !outward && error.is_finite() {
            self.airspeed_integral += AIRSPEED_KI * error * STEP;
        }
        raw.clamp(0.0, 1.0)
    }
}

impl Controller for Lqi {
    fn name(&self) -> &'static str {
        "lqi"
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, _seed: u64) {
        self.reference = None;
        self.integral = [0.0; 2];
        self.airspeed_integral = 0.0;
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        let [roll, pitch] = self.follow(seen, target);
        let (s, z) = (&seen.state, &seen.actuators);
        let entry = self.schedule.at(s.airspeed, roll, pitch);
        let [aileron, elevator] = entry.deflection;
        let was = |position: f64, rate: f64| position - rate * STEP;
        let sent = |command: f64| command * self.deflection;
        let [new, old] = seen.previous;
        let t = entry.steady;
        let x = SVector::<f64, STATES>::from([
            s.roll - roll,
            s.pitch - pitch,
            s.p - t[2],
            s.q - t[3],
            s.r - t[4],
            s.alpha - t[5],
            s.beta - t[6],
            z.aileron - aileron,
            was(z.aileron, z.aileron_rate) - aileron,
            sent(new.aileron) - aileron,
            sent(old.aileron) - aileron,
            z.elevator - elevator,
            was(z.elevator, z.elevator_rate) - elevator,
            sent(new.elevator) - elevator,
            sent(old.elevator) - elevator,
            self.integral[0],
            self.integral[1],
        ]);
        let mut u = -(entry.gain * x);
        u[1] += STALL_GAIN * (s.alpha - STALL_ALPHA).max(0.0);
        let raw = [(aileron + u[0]) / self.deflection, (elevator + u[1]) / self.deflection];
        // conditional integration: an axis whose surface is at its stop does not wind up
        for axis in 0..2 {
            if raw[axis].abs() < 1.0 && x[axis].is_finite() {
                self.integral[axis] += x[axis] * STEP;
            }
        }
        let throttle = self.throttle(seen, target, entry.throttle);
        Command { aileron: raw[0], elevator: raw[1], throttle }.clamped()
    }
}
