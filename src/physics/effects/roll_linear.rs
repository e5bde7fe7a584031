//! Rolling moment that is linear in sideslip, roll rate, yaw rate and aileron.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Rolling moment linear in sideslip, roll rate, yaw rate and aileron.
pub struct RollLinear;

impl Effect for RollLinear {
    const ID: &'static str = "roll_linear";
    const DESCRIPTION: &'static str =
        "Rolling moment linear in sideslip, roll and yaw rate and aileron.";
    const FORMULA: &'static str = "l = Q b (Cl0 + Clβ β + Clp p̂ + Clr r̂ + Clδa δa)";
    const SOURCE: &'static str = "GSFM26 eq. (44)";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient(
            "Cl0",
            "rolling moment coefficient of the symmetric condition",
            "",
            (-0.05, 0.05),
        ),
        coefficient("Clbeta", "dihedral effect", "1/rad", (-1.0, 0.5)),
        coefficient("Clp", "roll damping", "", (-2.0, 0.0)),
        coefficient("Clr", "rolling moment due to yaw rate", "", (-3.0, 3.0)),
        coefficient("Clda", "aileron power", "1/rad", (0.0, 1.0)),
    ];

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let q = at.air.q_s.scale(at.geometry.span);
        terms.add(0, Channel::Roll, q);
        terms.add(1, Channel::Roll, q * at.state.beta);
        terms.add(2, Channel::Roll, q * at.air.p_hat);
        terms.add(3, Channel::Roll, q * at.air.r_hat);
        terms.add(4, Channel::Roll, q * at.controls.aileron);
    }
}
