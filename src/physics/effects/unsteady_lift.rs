//! Lift and pitching moment that depend on the rate of the angle of attack.

use super::{Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// The effect `unsteady_lift`: lift and pitching moment are proportional to α̇ c/(2V).
pub struct UnsteadyLift;

impl Effect for UnsteadyLift {
    const ID: &'static str = "unsteady_lift";
    const DESCRIPTION: &'static str =
        "Lift and pitching moment due to the rate of the angle of attack.";
    const FORMULA: &'static str = "L = Q c/(2V) CLα̇ α̇, m = Q c²/(2V) Cmα̇ α̇";
    const SOURCE: &'static str = "Etkin and Reid, Dynamics of Flight, section 5.4";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("CLalphadot", "lift due to the rate of angle of attack", "", (-20.0, 20.0)),
        coefficient(
            "Cmalphadot",
            "pitching moment due to the rate of angle of attack",
            "",
            (-60.0, 60.0),
        ),
    ];
    const NEEDS: Needs = Needs::Rate;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Lift, Channel::Pitch],
        look_alikes: &["lift_linear.CLq", "pitch_linear.Cmq"],
        separated_by: "elevator doublets against steady pull-ups: α̇ and q then differ",
        example: &[3.0, -1.5],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let chord = at.geometry.chord;
        let rate = at.base.rate.alpha.scale(0.5 * chord) / at.state.airspeed;
        terms.add(0, Channel::Lift, at.air.q_s * rate);
        terms.add(1, Channel::Pitch, (at.air.q_s * rate).scale(chord));
    }
}
