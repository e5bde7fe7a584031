//! An effect of the catalogue: forces and moments of the rudder.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Side force, rolling moment and yawing moment that are linear in the rudder deflection.
pub struct RudderLinear;

impl Effect for RudderLinear {
    const ID: &'static str = "rudder_linear";
    const DESCRIPTION: &'static str =
        "Side force, rolling and yawing moment linear in the rudder's deflection.";
    const FORMULA: &'static str = "Y += Q CYδr δr, l += Q b Clδr δr, n += Q b Cnδr δr";
    const SOURCE: &'static str = "BM12 eqs. (4.14) to (4.16)";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("CYdr", "side force due to rudder", "1/rad", (-2.0, 2.0)),
        coefficient("Cldr", "rolling moment due to rudder", "1/rad", (-0.5, 0.5)),
        coefficient("Cndr", "yawing moment due to rudder", "1/rad", (-1.0, 1.0)),
    ];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Side, Channel::Roll, Channel::Yaw],
        look_alikes: &["yaw_linear.Cnbeta", "side_force_linear.CYbeta", "asymmetry"],
        separated_by: "rudder doublets: what the rudder does follows it at once, sideslip only after it",
        example: &[0.19, 0.0024, -0.069],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let force = at.air.q_s * at.controls.rudder;
        let moment = force.scale(at.geometry.span);
        terms.add(0, Channel::Side, force);
        terms.add(1, Channel::Roll, moment);
        terms.add(2, Channel::Yaw, moment);
    }
}
