//! Effect of an air density that differs from the model's.

use super::{AERODYNAMIC, Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Multiplies every aerodynamic force and moment by the same factor 1 + k.
pub struct AirDensity;

impl Effect for AirDensity {
    const ID: &'static str = "air_density";
    const DESCRIPTION: &'static str = "The air is denser than the model says: every aerodynamic force and moment grows by the same share.";
    const FORMULA: &'static str = "D, L, Y, l, m, n → (1 + k) times themselves";
    const SOURCE: &'static str = "Q = ½ρV²S";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "k",
        "share by which the density exceeds that of the model",
        "",
        (-0.5, 0.5),
    )];
    const NEEDS: Needs = Needs::Base;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[
            Channel::Drag,
            Channel::Lift,
            Channel::Side,
            Channel::Roll,
            Channel::Pitch,
            Channel::Yaw,
        ],
        look_alikes: &["mass_error", "airspeed_scale"],
        separated_by: "two altitudes under one known atmosphere; at one altitude, with free coefficients, no manoeuvre identifies it: it scales them all",
        example: &[0.2],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        for channel in AERODYNAMIC {
            terms.add(0, channel, at.base.wrench.get(channel));
        }
    }
}
