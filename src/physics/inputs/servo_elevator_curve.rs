//! Elevator servo or linkage whose gain changes with deflection, alike on both sides of neutral.

use super::{Acts, InputEffect, Past};
use crate::effects::{Coefficient, Entry, coefficient};
use greylag_num::Real;

/// An elevator that turns further than its recorded position where it is far from neutral, or less far if the constant is negative.
///
/// [`ServoElevator`](super::ServoElevator) is the part of a wrong servo that differs between the two sides; this is the part that
/// is alike on both, beyond an equal gain. It changes every force and moment of the elevator by the same share. The effect
/// `effectiveness_saturation` changes only moments, of both surfaces at once, by the square of the deflection.
pub struct ServoElevatorCurve;

impl InputEffect for ServoElevatorCurve {
    const ID: &'static str = "servo_elevator_curve";
    const DESCRIPTION: &'static str =
        "The gain of the elevator's servo or linkage changes with deflection.";
    const FORMULA: &'static str = "y = δe (1 + c |δe|)";
    const SOURCE: &'static str =
        "a gain that is alike on both sides of neutral, to first order in the deflection";
    const COEFFICIENTS: &'static [Coefficient; 1] =
        &[coefficient("c", "change of the gain per deflection", "1/rad", (-1.5, 1.5))];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &[
            "effectiveness_saturation",
            "servo_elevator",
            "dead_zone",
            "pitch_linear.Cmde",
        ],
        separated_by: "large against small elevator doublets, to both sides of neutral",
        example: &[0.5],
        starts: &[],
    };
    const ACTS: Acts = Acts::OnElevator;

    #[inline(always)]
    fn act<R: Real>(constant: f64, _: &mut Past<R>, input: R) -> R {
        input + (input * input.abs()).scale(constant)
    }
}
