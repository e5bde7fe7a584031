//! Lag of the thrust behind the throttle, due to the inertia of a propeller or of a turbine's rotor.

use super::{ActuatorLag, Acts, InputEffect, Past};
use greylag_num::Real;
use crate::effects::{Coefficient, Entry, coefficient};

/// A first-order lag from the recorded throttle position to the throttle that acts on the thrust.
pub struct ThrustLag;

impl InputEffect for ThrustLag {
    const ID: &'static str = "thrust_lag";
    const DESCRIPTION: &'static str =
        "The thrust follows the throttle with a first-order lag, as an engine takes time to change its speed.";
    const FORMULA: &'static str = "τ ẏ = δt − y, bilinear at 0.01 s; y acts in place of δt";
    const SOURCE: &'static str = "JSBSim's lag_filter";
    const COEFFICIENTS: &'static [Coefficient; 1] =
        &[coefficient("tau_s", "time constant", "s", (0.0, 10.0))];
    const ENTRY: Entry = Entry {
        channels: &[],
        look_alikes: &["thrust_decay", "thrust_scale"],
        separated_by: "steps of the throttle",
        example: &[0.4],
        starts: &[&[0.05], &[0.1], &[0.2], &[0.5], &[1.0], &[2.0], &[4.0]],
    };
    const ACTS: Acts = Acts::OnThrottle;

    #[inline(always)]
    fn act<R: Real>(constant: f64, memory: &mut Past<R>, input: R) -> R {
        ActuatorLag::act(constant, memory, input)
    }
}
