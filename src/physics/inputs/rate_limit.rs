//! An input effect, which changes the commanded deflections before they act: a rate limit of the surfaces.

use super::{InputEffect, Past, STEP};
use greylag_num::Real;
use crate::effects::{Coefficient, Entry, coefficient};

/// A limit on the rate of deflection of each surface.
pub struct RateLimit;

impl InputEffect for RateLimit {
    const ID: &'static str = "rate_limit";
    const DESCRIPTION: &'static str = "The surfaces move no faster than a limit.";
    const FORMULA: &'static str = "|ẏ| ≤ r";
    const SOURCE: &'static str = "JSBSim's rate_limit";
    const COEFFICIENTS: &'static [Coefficient; 1] =
        &[coefficient("rate_radps", "fastest movement", "rad/s", (0.05, 1000.0))];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &["actuator_lag", "time_delay"],
        separated_by: "large against small doublets",
        example: &[0.5],
        starts: &[&[8.0], &[4.0], &[2.0], &[1.0], &[0.5]],
    };

    #[inline(always)]
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R {
        let most = constant * STEP;
        memory.output += (input - memory.output).clamp(-most, most);
        memory.output
    }
}
