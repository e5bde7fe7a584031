//! Thrust line that does not pass through the centre of gravity.

use super::{Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Pitching moment of a thrust that acts below the centre of gravity.
pub struct ThrustLineOffset;

impl Effect for ThrustLineOffset {
    const ID: &'static str = "thrust_line_offset";
    const DESCRIPTION: &'static str =
        "The thrust acts below the centre of gravity, so that it pitches the aircraft up.";
    const FORMULA: &'static str = "m = z T";
    const SOURCE: &'static str = "r × F with the thrust at (0, 0, z)";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "z_m",
        "how far below the centre of gravity the thrust acts",
        "m",
        (-1.0, 1.0),
    )];
    const NEEDS: Needs = Needs::Base;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Pitch],
        look_alikes: &["pitch_linear.Cm0", "cg_shift", "propwash"],
        separated_by: "throttle doublets: Cm0 is independent of the throttle",
        example: &[0.03],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        terms.add(0, Channel::Pitch, at.base.wrench.get(Channel::BodyX));
    }
}
