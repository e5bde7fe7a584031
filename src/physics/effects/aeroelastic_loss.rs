//! Loss of control effectiveness by aeroelastic twist of the wing with airspeed.

use super::{AERODYNAMIC, Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point, State};

/// Airspeed at which the effect is zero, m/s: that of `State::NEUTRAL`.
const V0: f64 = State::NEUTRAL.airspeed;

/// Effectiveness of the control surfaces that decreases with dynamic pressure.
pub struct AeroelasticLoss;

impl Effect for AeroelasticLoss {
    const ID: &'static str = "aeroelastic_loss";
    const DESCRIPTION: &'static str =
        "The wing twists against its surfaces, which lose effectiveness with dynamic pressure.";
    const FORMULA: &'static str = "δ acts as δ (1 − k (V²/V0² − 1)), V0 = 16.67 m/s";
    const SOURCE: &'static str = "Bisplinghoff, Ashley and Halfman, Aeroelasticity, chapter 8: aileron effectiveness, to first order in dynamic pressure";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("k", "share of effectiveness lost from V0 to 1.41 V0", "", (-2.0, 2.0))];
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
        look_alikes: &["propwash", "roll_linear.Clda", "pitch_linear.Cmde"],
        separated_by: "aileron and elevator doublets from slow to fast flight at one throttle, diving for speed",
        example: &[0.2],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let ratio = at.state.airspeed.scale(1.0 / V0);
        let excess = ratio * ratio - R::from_f64(1.0);
        for channel in AERODYNAMIC {
            terms.add(0, channel, -at.base.deflected.get(channel) * excess);
        }
    }
}
