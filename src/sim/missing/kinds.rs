//! The effects that can be missing from a model, with amplitudes for an aircraft of the size of the Skywalker X8.

use rand::RngExt;

use super::{DRAW, rounded};
use greylag_num::stream::stream;

/// An effect that can be missing.
#[derive(Clone, Copy, Debug)]
pub struct MissingKind {
    /// Id of the effect in the catalogue.
    pub id: &'static str,
    /// Unit of the amplitude; empty if dimensionless.
    pub unit: &'static str,
    /// Range of amplitudes that are identifiable in a few minutes of flight while the aircraft remains flyable.
    pub clear: [f64; 2],
    /// Whether the amplitude may be negative.
    pub either_sign: bool,
}

const fn kind(id: &'static str, unit: &'static str, clear: [f64; 2]) -> MissingKind {
    MissingKind { id, unit, clear, either_sign: false }
}

const fn both(id: &'static str, unit: &'static str, clear: [f64; 2]) -> MissingKind {
    MissingKind { id, unit, clear, either_sign: true }
}

/// Effects that can be missing if the aircraft's model has them. They are removed from the model. The simulator stays as it is.
pub(super) const OF_THE_MODEL: [MissingKind; 2] =
    [kind("rudder_linear", "", [1.0, 1.0]), kind("propeller", "", [1.0, 1.0])];

/// The other effects that can be missing, with amplitudes for the size of the X8.
pub const KINDS: [MissingKind; 26] = [
    kind("drag_alpha2", "1/rad²", [0.6, 1.2]),
    kind("drag_beta2", "1/rad²", [0.5, 1.2]),
    kind("drag_elevator_abs", "1/rad", [0.08, 0.16]),
    kind("lift_stall", "", [1.0, 1.0]),
    kind("pitch_break", "1/rad³", [-3.0, -1.5]),
    both("cg_shift", "m", [0.008, 0.016]),
    kind("unsteady_lift", "", [2.0, 4.0]),
    kind("thrust_decay", "", [0.3, 0.5]),
    kind("thrust_scale", "N", [-10.0, -8.0]),
    both("thrust_line_offset", "m", [0.02, 0.04]),
    both("motor_torque", "N m", [0.4, 1.0]),
    both("propeller_gyro", "N m s", [0.04, 0.1]),
    kind("propwash", "", [0.3, 0.6]),
    kind("aeroelastic_loss", "", [0.1, 0.2]),
    kind("actuator_lag", "s", [0.02, 0.05]),
    kind("time_delay", "s", [0.02, 0.03]),
    kind("dead_zone", "rad", [0.015, 0.035]),
    kind("backlash", "rad", [0.02, 0.06]),
    kind("rate_limit", "rad/s", [1.6, 2.4]),
    kind("mass_error", "", [0.1, 0.2]),
    // positive only: at −0.1 the X8's inertia matrix is nearly singular, and no controller can fly it
    kind("inertia_xz", "kg m²", [0.06, 0.1]),
    both("asymmetry", "", [0.002, 0.004]),
    both("dihedral_alpha", "1/rad²", [0.3, 0.6]),
    both("roll_control_alpha", "1/rad²", [0.3, 0.5]),
    kind("effectiveness_saturation", "1/rad²", [-2.0, -1.0]),
    kind("thrust_lag", "s", [0.2, 0.6]),
];

/// Wrong servos, whose gain depends on the side of neutral or changes with deflection. They can be missing if they are asked for.
pub const SERVOS: [MissingKind; 4] = [
    both("servo_aileron", "", [0.1, 0.2]),
    both("servo_elevator", "", [0.1, 0.2]),
    both("servo_aileron_curve", "1/rad", [0.3, 0.6]),
    both("servo_elevator_curve", "1/rad", [0.3, 0.6]),
];

impl MissingKind {
    /// The effect `id`, with amplitudes for an aircraft of the size of the X8.
    pub fn from_id(id: &str) -> Option<MissingKind> {
        KINDS.iter().chain(&OF_THE_MODEL).chain(&SERVOS).copied().find(|kind| kind.id == id)
    }

    /// A clearly identifiable amplitude drawn from `seed`.
    pub fn amplitude(&self, seed: u64) -> f64 {
        let mut random = stream(seed, &[DRAW, 1]);
        let [low, high] = self.clear;
        let size = if low < high { random.random_range(low..high) } else { low };
        let signed = if self.either_sign && random.random::<bool>() { -size } else { size };
        self.allowed(rounded(signed))
    }

    /// The largest |amplitude| at which the aircraft still follows its schedule. For a rate limit it is the smallest one.
    pub fn most(&self) -> f64 {
        let largest = self.clear[0].abs().max(self.clear[1].abs());
        match self.id {
            "rate_limit" => self.clear[0],
            // beyond this value the inertia matrix is not positive definite
            "inertia_xz" => largest,
            // −29 N would cancel the whole thrust
            "thrust_scale" | "mass_error" => 2.0 * largest,
            // three times as much is out of the bounds of the effect
            id if SERVOS.iter().any(|servo| servo.id == id) => 2.0 * largest,
            _ => 3.0 * largest,
        }
    }

    /// `amplitude`, rounded if it is a delay: the simulator represents only delays of a whole number of 10 ms steps.
    pub fn allowed(&self, amplitude: f64) -> f64 {
        if self.id == "time_delay" {
            (100.0 * amplitude).round().max(1.0) / 100.0
        } else {
            amplitude
        }
    }
}
