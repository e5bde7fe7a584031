//! Additional lift as a curve over the angle of attack.

use super::{Coefficient, Effect, Needs, Own, Terms, curve};
use greylag_num::Real;
use crate::{Channel, Point};

/// Lift in addition to that of the other effects, as a curve over the angle of attack.
pub struct LiftCurve;

impl Effect for LiftCurve {
    const ID: &'static str = "lift_curve";
    const DESCRIPTION: &'static str =
        "Lift as flown: what it is more than the other effects say, stall included, over angle of attack.";
    const FORMULA: &'static str = "L = Q Σ CLk hk(α), hk falling from 1 at αk to 0 at the knots beside it";
    const SOURCE: &'static str = "piecewise linear, knots every 2°, from 10° to 20° every 1°, zero at 0° and 4°";
    const COEFFICIENTS: &'static [Coefficient] = curve::heights!("CL", (-0.5, 0.5));
    /// The effect is evaluated after those that depend only on state and controls. Otherwise `lift_stall` would remove its lift
    /// beyond the stall.
    const NEEDS: Needs = Needs::Base;

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        curve::hats(at.state.alpha, at.air.q_s, Channel::Lift, terms);
    }
}
