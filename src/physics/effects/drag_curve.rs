//! Additional drag as a curve over the angle of attack.

use super::{Coefficient, Effect, Own, Terms, curve};
use greylag_num::Real;
use crate::{Channel, Point};

/// Adds a drag coefficient to those of the other effects. It is a piecewise linear function of the angle of attack.
pub struct DragCurve;

impl Effect for DragCurve {
    const ID: &'static str = "drag_curve";
    const DESCRIPTION: &'static str =
        "Drag as flown: what it is more than the other effects say, over angle of attack.";
    const FORMULA: &'static str = "D = Q Σ CDk hk(α), hk falling from 1 at αk to 0 at the knots beside it";
    const SOURCE: &'static str = "piecewise linear, knots every 2°, from 10° to 20° every 1°, zero at 0° and 4°";
    const COEFFICIENTS: &'static [Coefficient] = curve::heights!("CD", (-0.2, 0.2));

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        curve::hats(at.state.alpha, at.air.q_s, Channel::Drag, terms);
    }
}
