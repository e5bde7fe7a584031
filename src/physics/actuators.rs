//! Actuators: from commands to the deflections that act on the airframe, exact at 0.01 s.
//!
//! JSBSim discretises each filter with the bilinear (Tustin) rule at the simulation step, so a
//! recurrence with the same coefficients reproduces it to rounding.

/// A command, the action of eq. (29) of \[GSFM26\] with throttle = (a_thr + 1)/2.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Command<R = f64> {
    /// Aileron, −1..1; positive rolls right.
    pub aileron: R,
    /// Elevator, −1..1; positive pitches down.
    pub elevator: R,
    /// Throttle, 0..1.
    pub throttle: R,
}

impl Command {
    /// Surfaces centred, motor off.
    pub const IDLE: Command = Command { aileron: 0.0, elevator: 0.0, throttle: 0.0 };

    /// Whether every component is a finite number.
    pub fn is_finite(&self) -> bool {
        self.aileron.is_finite() && self.elevator.is_finite() && self.throttle.is_finite()
    }

    /// The command limited to its ranges.
    pub fn clamped(self) -> Self {
        Command {
            aileron: self.aileron.clamp(-1.0, 1.0),
            elevator: self.elevator.clamp(-1.0, 1.0),
            throttle: self.throttle.clamp(0.0, 1.0),
        }
    }
}

/// What acts on the airframe at an instant: deflections and throttle position.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Controls<R = f64> {
    /// Aileron deflection δa, rad.
    pub aileron: R,
    /// Elevator deflection δe, rad; positive trailing edge down.
    pub elevator: R,
    /// Throttle position δt, 0..1.
    pub throttle: R,
}

/// The observed actuator state z, eq. (27) of \[GSFM26\].
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct ActuatorState<R = f64> {
    /// Aileron position, rad.
    pub aileron: R,
    /// Aileron rate, rad/s.
    pub aileron_rate: R,
    /// Elevator position, rad.
    pub elevator: R,
    /// Elevator rate, rad/s.
    pub elevator_rate: R,
    /// Throttle position, 0..1.
    pub throttle: R,
}

impl<R: Copy> ActuatorState<R> {
    /// The positions, which are what acts.
    #[inline(always)]
    pub fn controls(&self) -> Controls<R> {
        Controls { aileron: self.aileron, elevator: self.elevator, throttle: self.throttle }
    }
}
