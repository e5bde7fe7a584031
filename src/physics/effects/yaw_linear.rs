//! Yawing moment that is linear in sideslip, roll rate, yaw rate and aileron.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Yawing moment linear in sideslip, roll rate, yaw rate and aileron.
pub struct YawLinear;

impl Effect for YawLinear {
    const ID: &'static str = "yaw_linear";
    const DESCRIPTION: &'static str =
        "Yawing moment linear in sideslip, roll and yaw rate and aileron.";
    const FORMULA: &'static str = "n = Q b (Cn0 + Cnβ β + Cnp p̂ + Cnr r̂ + Cnδa δa)";
    const SOURCE: &'static str = "GSFM26 eq. (46)";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient(
            "Cn0",
            "yawing moment coefficient of the symmetric condition",
            "",
            (-0.05, 0.05),
        ),
        coefficient("Cnbeta", "weathercock stability", "1/rad", (-0.5, 2.0)),
        coefficient("Cnp", "yawing moment due to roll rate", "", (-1.0, 1.0)),
        coefficient("Cnr", "yaw damping", "", (-6.0, 0.5)),
        coefficient("Cnda", "adverse yaw", "1/rad", (-0.5, 0.5)),
    ];

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let q = at.air.q_s.scale(at.geometry.span);
        terms.add(0, Channel::Yaw, q);
        terms.add(1, Channel::Yaw, q * at.state.beta);
        terms.add(2, Channel::Yaw, q * at.air.p_hat);
        terms.add(3, Channel::Yaw, q * at.air.r_hat);
        terms.add(4, Channel::Yaw, q * at.controls.aileron);
    }
}
