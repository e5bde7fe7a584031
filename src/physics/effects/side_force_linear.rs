//! Side force that is linear in sideslip, roll rate, yaw rate and aileron.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// The effect `side_force_linear`, with the coefficients CY0, CYβ, CYp, CYr and CYδa.
pub struct SideForceLinear;

impl Effect for SideForceLinear {
    const ID: &'static str = "side_force_linear";
    const DESCRIPTION: &'static str =
        "Side force linear in sideslip, roll and yaw rate and aileron.";
    const FORMULA: &'static str = "Y = Q (CY0 + CYβ β + CYp p̂ + CYr r̂ + CYδa δa)";
    const SOURCE: &'static str = "GSFM26 eq. (42)";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("CY0", "side force coefficient of the symmetric condition", "", (-0.1, 0.1)),
        coefficient("CYbeta", "side force due to sideslip", "1/rad", (-2.0, 0.5)),
        coefficient("CYp", "side force due to roll rate", "", (-2.0, 2.0)),
        coefficient("CYr", "side force due to yaw rate", "", (-10.0, 10.0)),
        coefficient("CYda", "side force due to aileron", "1/rad", (-1.0, 1.0)),
    ];

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let q = at.air.q_s;
        terms.add(0, Channel::Side, q);
        terms.add(1, Channel::Side, q * at.state.beta);
        terms.add(2, Channel::Side, q * at.air.p_hat);
        terms.add(3, Channel::Side, q * at.air.r_hat);
        terms.add(4, Channel::Side, q * at.controls.aileron);
    }
}
