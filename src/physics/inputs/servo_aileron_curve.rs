//! Aileron servo or linkage whose gain changes with deflection, alike on both sides of neutral.

use super::{Acts, InputEffect, Past, ServoElevatorCurve};
use crate::effects::{Coefficient, Entry, coefficient};
use greylag_num::Real;

/// An aileron that turns further than its recorded position where it is far from neutral, or less far if the constant is negative.
///
/// See [`ServoElevatorCurve`] for what separates it from other effects.
pub struct ServoAileronCurve;

impl InputEffect for ServoAileronCurve {
    const ID: &'static str = "servo_aileron_curve";
    const DESCRIPTION: &'static str =
        "The gain of the ailerons' servo or linkage changes with deflection.";
    const FORMULA: &'static str = "y = δa (1 + c |δa|)";
    const SOURCE: &'static str =
        "a gain that is alike on both sides of neutral, to first order in the deflection";
    const COEFFICIENTS: &'static [Coefficient; 1] =
        &[coefficient("c", "change of the gain per deflection", "1/rad", (-1.5, 1.5))];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &[
            "effectiveness_saturation",
            "servo_aileron",
            "dead_zone",
            "roll_linear.Clda",
        ],
        separated_by: "large against small aileron doublets, to both sides of neutral",
        example: &[0.5],
        starts: &[],
    };
    const ACTS: Acts = Acts::OnAileron;

    #[inline(always)]
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R {
        ServoElevatorCurve::act(constant, memory, input)
    }
}
