//! Backlash in the linkage of the surfaces.

use super::{InputEffect, Past};
use greylag_num::Real;
use crate::effects::{Coefficient, Entry, coefficient};

/// Backlash of a surface: after a reversal of its input, the surface moves only when the play has been crossed.
pub struct Backlash;

impl InputEffect for Backlash {
    const ID: &'static str = "backlash";
    const DESCRIPTION: &'static str =
        "Play in the linkage: a surface that turns back first crosses it.";
    const FORMULA: &'static str = "y follows u at a distance of at most w/2";
    const SOURCE: &'static str = "JSBSim's hysteresis_width";
    const COEFFICIENTS: &'static [Coefficient; 1] =
        &[coefficient("width_rad", "whole width of the play", "rad", (0.0, 0.3))];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &["dead_zone", "time_delay"],
        separated_by: "small against large doublets away from the centre",
        example: &[0.02],
        starts: &[&[0.005], &[0.01], &[0.02], &[0.04], &[0.08]],
    };

    #[inline(always)]
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R {
        let half = R::from_f64(0.5 * constant);
        memory.output = memory.output.max(input - half).min(input + half);
        memory.output
    }
}
