//! Input effect of a dead zone of the surfaces. An input effect changes the deflections before they act on the aircraft.

use super::{InputEffect, Past};
use greylag_num::Real;
use crate::effects::{Coefficient, Entry, coefficient};

/// Removes deflections within the half width of the zone, and reduces larger ones by the half width.
pub struct DeadZone;

impl InputEffect for DeadZone {
    const ID: &'static str = "dead_zone";
    const DESCRIPTION: &'static str =
        "The surfaces do not act within a dead zone about their centre.";
    const FORMULA: &'static str = "y = 0 for |u| < d, else u − d sign(u)";
    const SOURCE: &'static str = "JSBSim's deadband";
    const COEFFICIENTS: &'static [Coefficient; 1] =
        &[coefficient("halfwidth_rad", "half the width of the zone", "rad", (0.0, 0.3))];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &[
            "effectiveness_saturation",
            "backlash",
            "servo_aileron_curve",
            "servo_elevator_curve",
        ],
        separated_by: "small against large doublets",
        example: &[0.02],
        starts: &[&[0.005], &[0.01], &[0.02], &[0.04], &[0.08]],
    };

    #[inline(always)]
    fn act<R: Real>(constant: f64, _: &mut Past<R>, input: R) -> R {
        input - input.clamp(-constant, constant)
    }
}
