//! Thrust that differs from the model's by an amount proportional to the throttle.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Additional thrust proportional to throttle.
pub struct ThrustScale;

impl Effect for ThrustScale {
    const ID: &'static str = "thrust_scale";
    const DESCRIPTION: &'static str =
        "The motor gives more thrust at full throttle than the model says.";
    const FORMULA: &'static str = "T = ΔCp δt";
    const SOURCE: &'static str = "GSFM26 eq. (38)";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "dCp_n",
        "thrust at full throttle minus that of the model",
        "N",
        (-1000.0, 1000.0),
    )];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::BodyX],
        look_alikes: &["thrust_linear.Cp_n", "thrust_decay", "drag_linear.CD0"],
        separated_by: "throttle doublets at one airspeed; a free thrust_linear.Cp_n is the same term, so only its prior width distinguishes them",
        example: &[-5.0],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        terms.add(0, Channel::BodyX, at.controls.throttle);
    }
}
