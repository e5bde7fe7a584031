//! A suspended load that pulls vertically down.

use super::{Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point, rigid_body};

/// A constant force at the centre of gravity in the direction of gravity.
///
/// A tether or a tow also pulls horizontally, in a direction fixed to the ground. Only the vertical part of such a force is
/// modelled, because the state has no heading. The load adds no mass. A load that moves with the aircraft is described by
/// `mass_error` instead.
pub struct ExternalLoad;

impl Effect for ExternalLoad {
    const ID: &'static str = "external_load";
    const DESCRIPTION: &'static str =
        "A tether or hanging load pulls the aircraft down with a constant force.";
    const FORMULA: &'static str = "F = k (−sin θ, cos θ sin φ, cos θ cos φ) in body axes";
    const SOURCE: &'static str =
        "a force fixed in earth axes, its vertical component; GSFM26 eq. (37) for the rotation";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("down_n", "force downward", "N", (-1000.0, 1000.0))];
    const NEEDS: Needs = Needs::Base;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Drag, Channel::Lift, Channel::Side],
        look_alikes: &["mass_error", "lift_linear.CL0", "accelerometer bias"],
        separated_by: "steep turns and pull-ups: a mass multiplies the load factor, a load does not",
        example: &[5.0],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let force = rigid_body::gravity_in_body(at.state, 1.0);
        let [drag, side, lift] = rigid_body::aerodynamic_force(force, at.air, at.axes);
        terms.add(0, Channel::Drag, drag);
        terms.add(0, Channel::Side, side);
        terms.add(0, Channel::Lift, lift);
    }
}
