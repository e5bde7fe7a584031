//! One LQI design: the gain that holds one flight condition.

use nalgebra::{Matrix2, SMatrix, SVector};

use super::riccati;
use crate::model::{GreyBox, Linear, STEP, Trim, linearise};

/// States of the design: φ θ p q r α β, then for aileron and elevator the deflection now and one
/// step ago with the two last commanded deflections, then ∫φ and ∫θ.
pub(super) const STATES: usize = 17;

/// The gain of one condition: rows aileron and elevator (rad).
pub(super) type Gain = SMatrix<f64, 2, STATES>;

/// Places of φ θ p q r α β in the state of eq. (4): airspeed is scheduled on, not fed back.
const ATTITUDE_STATES: [usize; 7] = [0, 1, 3, 4, 5, 6, 7];

/// What an error costs: one over the square of the size that is as bad as the others' (Bryson).
///
/// Found on the `jsbsim` model by settled error over the target file; the figures are forgiving.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Attitude error, rad.
    pub attitude: f64,
    /// Integrated attitude error, rad s.
    pub integral: f64,
    /// Body rate, rad/s.
    pub rate: f64,
    /// Sideslip, rad.
    pub sideslip: f64,
    /// Commanded deflection away from trim, rad.
    pub deflection: f64,
}

impl Weights {
    /// Those of the default design.
    pub const DEFAULT: Weights =
        Weights { attitude: 0.05, integral: 0.02, rate: 2.0, sideslip: 0.3, deflection: 0.3 };
    /// Softer loops that bear more delay: the pitch loop 104 ms where the default bears 46, and 78 where
    /// it bears 32 (`examples/delay_margin.rs`, behind ArduPlane's filter and sampling). Softer still
    /// (0.15, 0.1, 0.15) bears 200 ms.
    pub const DAMPED: Weights =
        Weights { attitude: 0.08, integral: 0.05, rate: 2.0, sideslip: 0.3, deflection: 0.2 };
}

/// The gain that holds `trim`, or `None` if the model cannot be stabilised there.
pub(super) fn design(model: &GreyBox, trim: &Trim, altitude: f64, w: &Weights) -> Option<Gain> {
    let (a, b) = augmented(model, &linearise(model, trim, altitude));
    let square = |x: f64| 1.0 / (x * x);
    let mut q = SVector::<f64, STATES>::zeros();
    (q[0], q[1]) = (square(w.attitude), square(w.attitude));
    (q[2], q[3], q[4]) = (square(w.rate), square(w.rate), square(w.rate));
    q[6] = square(w.sideslip);
    (q[15], q[16]) = (square(w.integral), square(w.integral));
    let r = Matrix2::from_diagonal_element(square(w.deflection));
    riccati::gain(&a, &b, &SMatrix::from_diagonal(&q), &r)
}

/// Attitude dynamics, actuator filters and integrators as one linear system.
fn augmented(
    model: &GreyBox,
    linear: &Linear,
) -> (SMatrix<f64, STATES, STATES>, SMatrix<f64, STATES, 2>) {
    let mut a = SMatrix::<f64, STATES, STATES>::zeros();
    let mut b = SMatrix::<f64, STATES, 2>::zeros();
    let [b0, a1, a2] = model.airframe.actuators.surface;
    for (i, from) in ATTITUDE_STATES.into_iter().enumerate() {
        for (j, to) in ATTITUDE_STATES.into_iter().enumerate() {
            a[(i, j)] = linear.a[(from, to)];
        }
        a[(i, 7)] = linear.b[(from, 0)];
        a[(i, 11)] = linear.b[(from, 1)];
    }
    for (surface, at) in [7, 11].into_iter().enumerate() {
        let (position, before, input, input_before) = (at, at + 1, at + 2, at + 3);
        a[(position, position)] = -a1;
        a[(position, before)] = -a2;
        a[(position, input)] = 2.0 * b0;
        a[(position, input_before)] = b0;
        b[(position, surface)] = b0;
        a[(before, position)] = 1.0;
        b[(input, surface)] = 1.0;
        a[(input_before, input)] = 1.0;
    }
    for axis in 0..2 {
        a[(15 + axis, axis)] = STEP;
        a[(15 + axis, 15 + axis)] = 1.0;
    }
    (a, b)
}
