//! Control effectiveness increased by the propeller's slipstream.

use super::{AERODYNAMIC, Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Throttle at which the effect is zero, 0..1: that of the X8 in level flight at 16.67 m/s.
const THROTTLE0: f64 = 0.118;

/// Effectiveness of the control surfaces that grows with throttle.
pub struct Propwash;

impl Effect for Propwash {
    const ID: &'static str = "propwash";
    const DESCRIPTION: &'static str =
        "The wash of the propeller makes the surfaces more effective.";
    const FORMULA: &'static str = "δ acts as δ (1 + k (δt − 0.118))";
    const SOURCE: &'static str =
        "slipstream over the surfaces, to first order in throttle about the trim at 16.67 m/s";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "k",
        "change of effectiveness from no throttle to full throttle",
        "",
        (-5.0, 5.0),
    )];
    const NEEDS: Needs = Needs::Parts;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[
            Channel::Drag,
            Channel::Lift,
            Channel::Side,
            Channel::Roll,
            Channel::Pitch,
            Channel::Yaw,
        ],
        look_alikes: &["aeroelastic_loss", "roll_linear.Clda", "pitch_linear.Cmde"],
        separated_by: "aileron and elevator doublets at several throttles and one airspeed",
        example: &[0.8],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let excess = at.controls.throttle - R::from_f64(THROTTLE0);
        for channel in AERODYNAMIC {
            terms.add(0, channel, at.base.deflected.get(channel) * excess);
        }
    }
}
