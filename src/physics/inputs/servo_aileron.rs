//! Aileron servo or linkage with different gains on the two sides of neutral.

use super::{Acts, InputEffect, Past, ServoElevator};
use crate::effects::{Coefficient, Entry, coefficient};
use greylag_num::Real;

/// An aileron that turns further than its recorded position on one side of neutral, and less on the other.
///
/// See [`ServoElevator`] for what it has in common with a gain, an offset and effects of the air.
pub struct ServoAileron;

impl InputEffect for ServoAileron {
    const ID: &'static str = "servo_aileron";
    const DESCRIPTION: &'static str =
        "The ailerons' servo is calibrated differently on the two sides of neutral.";
    const FORMULA: &'static str = "y = δa (1 + k sign(δa)) = δa + k |δa|";
    const SOURCE: &'static str = "end points of a servo set apart; JSBSim's aerosurface_scale";
    const COEFFICIENTS: &'static [Coefficient; 1] = &[coefficient(
        "k",
        "half the difference of the gains, positive minus negative aileron",
        "",
        (-0.5, 0.5),
    )];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &[
            "roll_linear.Clda",
            "asymmetry",
            "effectiveness_saturation",
            "servo_aileron_curve",
        ],
        separated_by: "aileron doublets to both sides of neutral: an asymmetry acts without them too",
        example: &[0.2],
        starts: &[],
    };
    const ACTS: Acts = Acts::OnAileron;

    #[inline(always)]
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R {
        ServoElevator::act(constant, memory, input)
    }
}
