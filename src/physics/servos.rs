//! Servos: travel, rate limit and discrete-time filter of each actuator.

use crate::{Command, Controls};
use greylag_num::Real;

/// Travel of a surface: its deflections at the commands −1 and 1, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Deflection at the command −1, rad, negative.
    pub least: f64,
    /// Deflection at the command 1, rad, positive.
    pub most: f64,
}

impl Travel {
    /// The symmetric travel ±`most`, rad.
    pub const fn symmetric(most: f64) -> Travel {
        Travel { least: -most, most }
    }

    /// Whether the travel is symmetric.
    #[inline(always)]
    pub fn is_symmetric(&self) -> bool {
        self.least == -self.most
    }

    /// The larger magnitude of the two limits, rad.
    pub fn largest(&self) -> f64 {
        self.most.max(-self.least)
    }

    /// The smaller magnitude of the two limits, rad. The surface reaches this deflection on both sides.
    pub fn smallest(&self) -> f64 {
        self.most.min(-self.least)
    }

    /// Whether `deflection` (rad) lies strictly between the limits.
    pub fn reaches(&self, deflection: f64) -> bool {
        self.least < deflection && deflection < self.most
    }

    /// Deflection per unit of command, rad, on the side of zero on which `deflection` lies.
    pub fn slope(&self, deflection: f64) -> f64 {
        if deflection < 0.0 { -self.least } else { self.most }
    }

    /// The command for `deflection` (rad), without limits: its ratio to the travel on its side of zero.
    pub fn part(&self, deflection: f64) -> f64 {
        deflection / self.slope(deflection)
    }

    /// Deflection (rad) for `command` (−1..1), without limits.
    #[inline(always)]
    pub fn deflection<R: Real>(&self, command: R) -> R {
        if self.is_symmetric() {
            return command.scale(self.most);
        }
        let (down, up) = (command.scale(-self.least), command.scale(self.most));
        R::where_less(command, R::zero(), down, up)
    }

    /// Command for `deflection` (rad), without limits.
    #[inline(always)]
    pub fn command<R: Real>(&self, deflection: R) -> R {
        if self.is_symmetric() {
            return deflection.scale(1.0 / self.most);
        }
        let (down, up) = (deflection.scale(-1.0 / self.least), deflection.scale(1.0 / self.most));
        R::where_less(deflection, R::zero(), down, up)
    }
}

/// Travels of an aircraft's surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travels {
    /// Travel of the ailerons.
    pub aileron: Travel,
    /// Travel of the elevator.
    pub elevator: Travel,
    /// Travel of the rudder. `None` if the aircraft has no rudder.
    pub rudder: Option<Travel>,
}

impl Travels {
    /// Ailerons and elevator with the same symmetric travel ±`most` (rad), without a rudder.
    pub const fn alike(most: f64) -> Travels {
        let travel = Travel::symmetric(most);
        Travels { aileron: travel, elevator: travel, rudder: None }
    }
}

/// Actuator of a surface: its discrete-time filter for a given time step, its travel and its rate limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Coefficients b0, a1, a2 of y = b0 (u + 2u₋₁ + u₋₂) − a1 y₋₁ − a2 y₋₂.
    pub filter: [f64; 3],
    /// Deflections at full command, which are also the travel limits.
    pub travel: Travel,
    /// Rate limit, rad/s. `None` if only the filter limits the rate.
    pub rate_max: Option<f64>,
}

impl Surface {
    /// The bilinear transform of ω²/(s² + 2ζωs + ω²) with `frequency` ω (rad/s) and `damping` ζ at the time step `step` (s).
    pub fn tustin(frequency: f64, damping: f64, travel: Travel, step: f64) -> Surface {
        let w = frequency * step;
        let d = 4.0 + 4.0 * damping * w + w * w;
        let filter = [w * w / d, (2.0 * w * w - 8.0) / d, (4.0 - 4.0 * damping * w + w * w) / d];
        Surface { filter, travel, rate_max: None }
    }
}

/// The actuators of an aircraft, with discrete-time filters for a given time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorFigures {
    /// Actuator of the ailerons.
    pub aileron: Surface,
    /// Actuator of the elevator.
    pub elevator: Surface,
    /// Actuator of the rudder. `None` if the aircraft has no rudder.
    pub rudder: Option<Surface>,
    /// Coefficients b, a of the throttle's first-order lag y = b (u + u₋₁) + a y₋₁.
    pub throttle: [f64; 2],
    /// Time step of the filters, s.
    pub step: f64,
}

impl ActuatorFigures {
    /// Identical actuators of ailerons and elevator with `frequency` (rad/s), `damping` and travel ±`deflection_max` (rad),
    /// without a rudder. The throttle has the time constant `lag` (s). The time step is `step` (s).
    pub fn tustin(frequency: f64, damping: f64, deflection_max: f64, lag: f64, step: f64) -> Self {
        let travel = Travel::symmetric(deflection_max);
        let surface = Surface::tustin(frequency, damping, travel, step);
        let throttle = ActuatorFigures::lag(lag, step);
        ActuatorFigures { aileron: surface, elevator: surface, rudder: None, throttle, step }
    }

    /// Coefficients b, a of the bilinear transform of 1/(τs + 1) with time constant `lag` (s) at the time step `step` (s).
    pub fn lag(lag: f64, step: f64) -> [f64; 2] {
        let k = step / lag;
        [k / (2.0 + k), (2.0 - k) / (2.0 + k)]
    }

    /// The travels of the surfaces.
    pub fn travels(&self) -> Travels {
        Travels {
            aileron: self.aileron.travel,
            elevator: self.elevator.travel,
            rudder: self.rudder.map(|rudder| rudder.travel),
        }
    }

    /// Command that gives the deflections and the throttle of `controls` in steady state, limited to the ranges of commands.
    pub fn command(&self, controls: &Controls) -> Command {
        Command {
            aileron: self.aileron.travel.part(controls.aileron),
            elevator: self.elevator.travel.part(controls.elevator),
            throttle: controls.throttle,
            rudder: self.rudder.map_or(0.0, |rudder| rudder.travel.part(controls.rudder)),
        }
        .clamped()
    }

    /// Deflections and throttle in steady state with `command`.
    pub fn controls(&self, command: &Command) -> Controls {
        Controls {
            aileron: self.aileron.travel.deflection(command.aileron),
            elevator: self.elevator.travel.deflection(command.elevator),
            throttle: command.throttle,
            rudder: self.rudder.map_or(0.0, |rudder| rudder.travel.deflection(command.rudder)),
            lagged: None,
        }
    }
}
