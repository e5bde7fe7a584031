//! Aileron effectiveness that depends on the angle of attack.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Adds rolling and yawing moments that are proportional to the product of angle of attack and aileron deflection.
pub struct RollControlAlpha;

impl Effect for RollControlAlpha {
    const ID: &'static str = "roll_control_alpha";
    const DESCRIPTION: &'static str = "The aileron rolls and yaws differently at large angles of attack: lost power, adverse yaw.";
    const FORMULA: &'static str = "l = Q b Clαδa α δa, n = Q b Cnαδa α δa";
    const SOURCE: &'static str = "Klein and Morelli, Aircraft System Identification, section 3.3: product terms of the Taylor series";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient(
            "Clalphada",
            "rolling moment due to the product of incidence and aileron",
            "1/rad²",
            (-10.0, 10.0),
        ),
        coefficient(
            "Cnalphada",
            "yawing moment due to the product of incidence and aileron",
            "1/rad²",
            (-10.0, 10.0),
        ),
    ];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Roll, Channel::Yaw],
        look_alikes: &["roll_linear.Clda", "aeroelastic_loss", "dihedral_alpha"],
        separated_by: "aileron pulses at two angles of attack and one airspeed, in a bank with and without pull",
        example: &[-0.6, 0.1],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let product = at.state.alpha * at.controls.aileron;
        let moment = at.air.q_s.scale(at.geometry.span) * product;
        terms.add(0, Channel::Roll, moment);
        terms.add(1, Channel::Yaw, moment);
    }
}
