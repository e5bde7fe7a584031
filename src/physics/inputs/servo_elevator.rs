//! Elevator servo or linkage with different gains on the two sides of neutral.

use super::{Acts, InputEffect, Past};
use crate::effects::{Coefficient, Entry, coefficient};
use greylag_num::Real;

/// An elevator that turns further than its recorded position on one side of neutral, and less on the other.
///
/// An offset of the servo is a trim of the model, and an equal gain on both sides is a factor on its control derivatives. What
/// remains of a wrong calibration is the difference between the two sides. It changes every force and moment of the elevator by
/// the same share, which no aerodynamic effect of the catalogue does.
pub struct ServoElevator;

impl InputEffect for ServoElevator {
    const ID: &'static str = "servo_elevator";
    const DESCRIPTION: &'static str =
        "The elevator's servo is calibrated differently on the two sides of neutral.";
    const FORMULA: &'static str = "y = δe (1 + k sign(δe)) = δe + k |δe|";
    const SOURCE: &'static str = "end points of a servo set apart; JSBSim's aerosurface_scale";
    const COEFFICIENTS: &'static [Coefficient; 1] =
        &[coefficient("k", "half the difference of the gains, down minus up", "", (-0.5, 0.5))];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &[
            "pitch_linear.Cmde",
            "drag_elevator_abs",
            "effectiveness_saturation",
            "servo_elevator_curve",
        ],
        separated_by: "elevator doublets to both sides of neutral: on one side alone it is a gain",
        example: &[0.2],
        starts: &[],
    };
    const ACTS: Acts = Acts::OnElevator;

    #[inline(always)]
    fn act<R: Real>(constant: f64, _: &mut Past<R>, input: R) -> R {
        input + input.abs().scale(constant)
    }
}
