//! First-order lag of the surfaces behind their measured position.

use super::{InputEffect, Past, STEP};
use greylag_num::Real;
use crate::effects::{Coefficient, Entry, coefficient};

/// A first-order lag between the measured position and the acting deflection.
pub struct ActuatorLag;

impl InputEffect for ActuatorLag {
    const ID: &'static str = "actuator_lag";
    const DESCRIPTION: &'static str = "The surfaces act with a first-order lag.";
    const FORMULA: &'static str = "τ ẏ = u − y, bilinear at 0.01 s";
    const SOURCE: &'static str = "JSBSim's lag_filter";
    const COEFFICIENTS: &'static [Coefficient; 1] =
        &[coefficient("tau_s", "time constant", "s", (0.0, 2.0))];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &["time_delay", "rate_limit"],
        separated_by: "aileron and elevator above 2 Hz",
        example: &[0.04],
        starts: &[&[0.01], &[0.02], &[0.04], &[0.08], &[0.16], &[0.32]],
    };

    #[inline(always)]
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R {
        let (gain, keep) =
            (STEP / (2.0 * constant + STEP), (2.0 * constant - STEP) / (2.0 * constant + STEP));
        memory.output = (input + memory.inputs[0]).scale(gain) + memory.output.scale(keep);
        memory.inputs[0] = input;
        memory.output
    }
}
