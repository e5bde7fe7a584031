//! An effect of the catalogue: the linear part of the lift.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Lift that is linear in angle of attack, pitch rate and elevator deflection.
pub struct LiftLinear;

impl Effect for LiftLinear {
    const ID: &'static str = "lift_linear";
    const DESCRIPTION: &'static str = "Lift linear in angle of attack, pitch rate and elevator.";
    const FORMULA: &'static str = "L = Q (CL0 + CLα α + CLq q̂ + CLδe δe)";
    const SOURCE: &'static str = "GSFM26 eq. (41)";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("CL0", "lift coefficient at zero incidence", "", (-1.0, 1.0)),
        coefficient("CLalpha", "lift slope", "1/rad", (0.0, 10.0)),
        coefficient("CLq", "lift due to pitch rate", "", (-40.0, 40.0)),
        coefficient("CLde", "lift due to elevator", "1/rad", (-6.0, 6.0)),
    ];

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let q = at.air.q_s;
        terms.add(0, Channel::Lift, q);
        terms.add(1, Channel::Lift, q * at.state.alpha);
        terms.add(2, Channel::Lift, q * at.air.q_hat);
        terms.add(3, Channel::Lift, q * at.controls.elevator);
    }
}
