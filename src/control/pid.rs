//! PID controller with three independent loops: roll by aileron, pitch by elevator, airspeed by throttle.

use crate::{Controller, Observation, Overruled, Target, winds_up};
use greylag_model::STEP;
use greylag_physics::Command;

/// Gains of one loop: output = trim + kp·e + ki·∫e − kd·rate. The output is a surface deflection (rad) or the throttle (0..1).
/// The error e is in rad or m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Proportional gain on the error.
    pub kp: f64,
    /// Integral gain on the error, output per unit of the error and second.
    pub ki: f64,
    /// Gain on the measured body rate p or q, output per rad/s. The law subtracts this term. Zero in the airspeed loop.
    pub kd: f64,
}

/// A named set of PID gains with its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Name in the controller registry.
    pub name: &'static str,
    /// Gains from the roll error (rad) to the aileron (rad).
    pub roll: Gains,
    /// Gains from the pitch error (rad) to the elevator (rad).
    pub pitch: Gains,
    /// Gains from the airspeed error (m/s) to the throttle (0..1).
    pub airspeed: Gains,
    /// Throttle at zero airspeed error, 0..1.
    pub throttle_trim: f64,
    /// Deflection of aileron and elevator at full command, rad.
    pub deflection: f64,
    /// Airspeed that is held instead of the target airspeed, m/s. `None` holds the target airspeed.
    pub airspeed_override: Option<f64>,
    /// Anti-windup: behaviour of an integrator while its output saturates.
    pub windup: Windup,
}

/// Integrator behaviour under saturation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Windup {
    /// The integrator continues to integrate, as in the controller of FW-JSBGym ([`PUBLIC`]).
    Free,
    /// Conditional integration: the integrator stops when it would drive the output further into saturation.
    Clamped,
}

/// Gains published with the simulator FW-JSBGym, the baseline of comparisons. They are from the version of its `pid_eval` that
/// was the latest in 2026. In an earlier version kp, ki and kd were 1.0, 0 and 0.5 for roll, −4, −0.75 and −0.1 for pitch.
pub const PUBLIC: Tuning = Tuning {
    name: "pid",
    roll: Gains { kp: 1.5, ki: 0.1, kd: 0.1 },
    pitch: Gains { kp: -2.0, ki: -0.3, kd: -0.1 },
    airspeed: Gains { kp: 0.5, ki: 0.1, kd: 0.0 },
    throttle_trim: 0.129_514,
    deflection: std::f64::consts::FRAC_PI_6,
    airspeed_override: None,
    windup: Windup::Free,
};

/// Gains tuned in the simulator by random search over the shipped targets (240 trials). The controller holds 22 m/s, at a
/// distance from the stall.
#[expect(clippy::approx_constant, reason = "the simulator's stop is at 0.5235 rad, not at 30°")]
pub const RETUNED: Tuning = Tuning {
    name: "pid-retuned",
    roll: Gains { kp: 2.54, ki: 0.59, kd: 0.047 },
    pitch: Gains { kp: -0.48, ki: -0.52, kd: -0.06 },
    airspeed: Gains { kp: 0.21, ki: 0.11, kd: 0.0 },
    throttle_trim: 0.2,
    deflection: 0.523_5,
    airspeed_override: Some(22.0),
    windup: Windup::Clamped,
};

/// The PID attitude controller.
#[derive(Clone, Debug)]
pub struct Pid {
    tuning: Tuning,
    integrals: [f64; 3],
    /// Increments of the integrators by the last command.
    added: [f64; 3],
}

impl Pid {
    /// A controller with the gains of `tuning` and zero integrators.
    pub fn new(tuning: Tuning) -> Pid {
        Pid { tuning, integrals: [0.0; 3], added: [0.0; 3] }
    }

    /// Output of one loop, limited to `stops` (minimum, maximum). Updates the loop's integrator.
    fn step(
        &mut self,
        axis: usize,
        gains: Gains,
        error: f64,
        rate: f64,
        bias: f64,
        stops: (f64, f64),
    ) -> f64 {
        let grown = self.integrals[axis] + error * STEP;
        let output =
            |integral: f64| bias + gains.kp * error + gains.ki * integral - gains.kd * rate;
        let raw = output(grown);
        let outward =
            (raw > stops.1 && gains.ki * error > 0.0) || (raw < stops.0 && gains.ki * error < 0.0);
        self.added[axis] = 0.0;
        if grown.is_finite() && (self.tuning.windup == Windup::Free || !outward) {
            self.added[axis] = grown - self.integrals[axis];
            self.integrals[axis] = grown;
        }
        output(if grown.is_finite() { self.integrals[axis] } else { grown }).clamp(stops.0, stops.1)
    }
}

impl Controller for Pid {
    fn name(&self) -> &'static str {
        self.tuning.name
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, _seed: u64) {
        self.integrals = [0.0; 3];
        self.added = [0.0; 3];
    }

    fn overruled(&mut self, by: &Overruled) {
        if self.tuning.windup == Windup::Free {
            return;
        }
        let Overruled { wanted, flown } = by;
        let moved = [flown.aileron - wanted.aileron, flown.elevator - wanted.elevator];
        for (axis, gains) in [self.tuning.roll, self.tuning.pitch].into_iter().enumerate() {
            if winds_up(moved[axis], gains.ki * self.added[axis]) {
                self.integrals[axis] -= std::mem::take(&mut self.added[axis]);
            }
        }
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        let t = self.tuning;
        let s = &seen.state;
        let stops = (-t.deflection, t.deflection);
        let airspeed = t.airspeed_override.unwrap_or(target.airspeed);
        let aileron = self.step(0, t.roll, target.roll - s.roll, s.p, 0.0, stops);
        let elevator = self.step(1, t.pitch, target.pitch - s.pitch, s.q, 0.0, stops);
        let throttle =
            self.step(2, t.airspeed, airspeed - s.airspeed, 0.0, t.throttle_trim, (0.0, 1.0));
        Command {
            aileron: aileron / t.deflection,
            elevator: elevator / t.deflection,
            throttle,
            rudder: 0.0,
        }
    }
}
