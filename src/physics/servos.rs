//! Servos: how far, how fast and with which lag each control follows its command.

use crate::{Command, Controls};
use greylag_num::Real;

/// How far a surface goes, rad: its deflections at the commands −1 and 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Deflection at the command −1, below zero.
    pub least: f64,
    /// Deflection at the command 1, above zero.
    pub most: f64,
}

impl Travel {
    /// The same to both sides, rad.
    pub const fn symmetric(most: f64) -> Travel {
        Travel { least: -most, most }
    }

    /// Whether it is the same to both sides.
    #[inline(always)]
    pub fn is_symmetric(&self) -> bool {
        self.least == -self.most
    }

    /// The larger of both sides, rad.
    pub fn largest(&self) -> f64 {
        self.most.max(-self.least)
    }

    /// The smaller of both sides, rad: what can be reached either way.
    pub fn smallest(&self) -> f64 {
        self.most.min(-self.least)
    }

    /// Whether `deflection` (rad) lies within the stops.
    pub fn reaches(&self, deflection: f64) -> bool {
        self.least < deflection && deflection < self.most
    }

    /// The deflection (rad) that a command of one asks for on the side of `deflection`.
    pub fn slope(&self, deflection: f64) -> f64 {
        if deflection < 0.0 { -self.least } else { self.most }
    }

    /// `deflection` (rad) in parts of the travel to its side.
    pub fn part(&self, deflection: f64) -> f64 {
        deflection / self.slope(deflection)
    }

    /// The deflection (rad) that `command` asks for.
    #[inline(always)]
    pub fn deflection<R: Real>(&self, command: R) -> R {
        if self.is_symmetric() {
            return command.scale(self.most);
        }
        let (down, up) = (command.scale(-self.least), command.scale(self.most));
        R::where_less(command, R::zero(), down, up)
    }

    /// The command that asks for `deflection` (rad).
    #[inline(always)]
    pub fn command<R: Real>(&self, deflection: R) -> R {
        if self.is_symmetric() {
            return deflection.scale(1.0 / self.most);
        }
        let (down, up) = (deflection.scale(-1.0 / self.least), deflection.scale(1.0 / self.most));
        R::where_less(deflection, R::zero(), down, up)
    }
}

/// How far the surfaces of an aircraft go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travels {
    /// The ailerons.
    pub aileron: Travel,
    /// The elevator.
    pub elevator: Travel,
    /// The rudder, where there is one.
    pub rudder: Option<Travel>,
}

impl Travels {
    /// Ailerons and elevator by `most` (rad) to both sides, no rudder.
    pub const fn alike(most: f64) -> Travels {
        let travel = Travel::symmetric(most);
        Travels { aileron: travel, elevator: travel, rudder: None }
    }
}

/// One surface: its travel, its filter at one time step, its largest rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// b0, a1, a2 of y = b0 (u + 2u₋₁ + u₋₂) − a1 y₋₁ − a2 y₋₂.
    pub filter: [f64; 3],
    /// Deflections at full command, which are also the stops.
    pub travel: Travel,
    /// Largest rate, rad/s; `None` if nothing limits it but the filter.
    pub rate_max: Option<f64>,
}

impl Surface {
    /// The bilinear transform of ω²/(s² + 2ζωs + ω²), `frequency` in rad/s, at `step` (s).
    pub fn tustin(frequency: f64, damping: f64, travel: Travel, step: f64) -> Surface {
        let w = frequency * step;
        let d = 4.0 + 4.0 * damping * w + w * w;
        let filter = [w * w / d, (2.0 * w * w - 8.0) / d, (4.0 - 4.0 * damping * w + w * w) / d];
        Surface { filter, travel, rate_max: None }
    }
}

/// The actuators' discrete filters at one time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorFigures {
    /// The ailerons.
    pub aileron: Surface,
    /// The elevator.
    pub elevator: Surface,
    /// The rudder, where there is one.
    pub rudder: Option<Surface>,
    /// b, a of y = b (u + u₋₁) + a y₋₁.
    pub throttle: [f64; 2],
    /// Time step, s.
    pub step: f64,
}

impl ActuatorFigures {
    /// Ailerons and elevator alike, of `frequency` (rad/s), `damping` and `deflection_max` (rad), no
    /// rudder, and a throttle with `lag` (s), at `step` (s).
    pub fn tustin(frequency: f64, damping: f64, deflection_max: f64, lag: f64, step: f64) -> Self {
        let travel = Travel::symmetric(deflection_max);
        let surface = Surface::tustin(frequency, damping, travel, step);
        let throttle = ActuatorFigures::lag(lag, step);
        ActuatorFigures { aileron: surface, elevator: surface, rudder: None, throttle, step }
    }

    /// The bilinear transform of 1/(τs + 1), `lag` and `step` in s.
    pub fn lag(lag: f64, step: f64) -> [f64; 2] {
        let k = step / lag;
        [k / (2.0 + k), (2.0 - k) / (2.0 + k)]
    }

    /// How far the surfaces go.
    pub fn travels(&self) -> Travels {
        Travels {
            aileron: self.aileron.travel,
            elevator: self.elevator.travel,
            rudder: self.rudder.map(|rudder| rudder.travel),
        }
    }

    /// The command that asks for these deflections and this throttle, limited to its ranges.
    pub fn command(&self, controls: &Controls) -> Command {
        Command {
            aileron: self.aileron.travel.part(controls.aileron),
            elevator: self.elevator.travel.part(controls.elevator),
            throttle: controls.throttle,
            rudder: self.rudder.map_or(0.0, |rudder| rudder.travel.part(controls.rudder)),
        }
        .clamped()
    }

    /// What `command` comes to rest at.
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
