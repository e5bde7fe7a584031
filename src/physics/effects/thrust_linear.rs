//! Thrust that is proportional to throttle and independent of airspeed.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Adds a force along body x that is proportional to the throttle.
pub struct ThrustLinear;

impl Effect for ThrustLinear {
    const ID: &'static str = "thrust_linear";
    const DESCRIPTION: &'static str = "Thrust along body x, proportional to throttle.";
    const FORMULA: &'static str = "T = Cp δt";
    const SOURCE: &'static str = "GSFM26 eq. (38)";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("Cp_n", "thrust at full throttle", "N", (0.0, 10_000.0))];

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        terms.add(0, Channel::BodyX, at.controls.throttle);
    }
}
