//! Time delay of the surfaces behind their measured position.

use super::{InputEffect, PAST, Past, STEP};
use greylag_num::Real;
use crate::effects::{Coefficient, Entry, coefficient};

/// A pure delay, with linear interpolation between samples.
pub struct TimeDelay;

impl InputEffect for TimeDelay {
    const ID: &'static str = "time_delay";
    const DESCRIPTION: &'static str = "The surfaces act after a delay.";
    const FORMULA: &'static str = "y(t) = u(t − T)";
    const SOURCE: &'static str = "a pure delay";
    const COEFFICIENTS: &'static [Coefficient; 1] =
        &[coefficient("delay_s", "delay", "s", (0.0, (PAST - 2) as f64 * STEP))];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &["actuator_lag", "clock_skew"],
        separated_by: "slow and fast aileron and elevator: the delay is the same for both",
        example: &[0.05],
        starts: &[&[0.01], &[0.02], &[0.03], &[0.05], &[0.08], &[0.12]],
    };

    #[inline(always)]
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R {
        memory.push(input);
        let samples = (constant / STEP).clamp(0.0, (PAST - 2) as f64);
        let (whole, part) = (samples.floor() as usize, samples.fract());
        memory.inputs[whole].scale(1.0 - part) + memory.inputs[whole + 1].scale(part)
    }
}
