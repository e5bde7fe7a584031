//! Control moments that are not proportional to the deflection.

use super::{Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Roll and pitch effectiveness that changes with the square of the deflection.
pub struct EffectivenessSaturation;

impl Effect for EffectivenessSaturation {
    const ID: &'static str = "effectiveness_saturation";
    const DESCRIPTION: &'static str =
        "The surfaces' rolling and pitching moments saturate at large deflections.";
    const FORMULA: &'static str = "l = k l_δ δa², m = k m_δ δe²; l_δ, m_δ the linear moments";
    const SOURCE: &'static str = "Klein and Morelli, Aircraft System Identification, section 3.3";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("k_perrad2", "change of effectiveness", "1/rad²", (-10.0, 10.0))];
    const NEEDS: Needs = Needs::Parts;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Roll, Channel::Pitch],
        look_alikes: &[
            "dead_zone",
            "servo_aileron_curve",
            "servo_elevator_curve",
            "roll_linear.Clda",
            "pitch_linear.Cmde",
        ],
        separated_by: "large against small steps of aileron and elevator",
        example: &[-2.0],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let (aileron, elevator) = (at.controls.aileron, at.controls.elevator);
        let of = |channel| at.base.deflected.get(channel);
        terms.add(0, Channel::Roll, of(Channel::Roll) * aileron * aileron);
        terms.add(0, Channel::Pitch, of(Channel::Pitch) * elevator * elevator);
    }
}
