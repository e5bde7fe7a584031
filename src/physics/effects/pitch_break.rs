//! Pitching moment that becomes nonlinear at large angles of attack.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point, State};

/// Pitching moment proportional to the cube of the angle of attack.
pub struct PitchBreak;

impl Effect for PitchBreak {
    const ID: &'static str = "pitch_break";
    const DESCRIPTION: &'static str =
        "Pitching moment as the cube of angle of attack: stability that changes towards the stall.";
    const FORMULA: &'static str = "m = Q c Cmα³ α³";
    const SOURCE: &'static str = "Klein and Morelli, Aircraft System Identification, section 3.3";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "Cmalpha3",
        "pitching moment due to the cube of incidence",
        "1/rad³",
        (-200.0, 200.0),
    )];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Pitch],
        look_alikes: &["cg_shift", "pitch_linear.Cmalpha", "lift_stall"],
        separated_by: "slow to large angles of attack of both signs: the cube vanishes at small ones",
        example: &[-3.0],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let State { alpha, .. } = *at.state;
        let moment = at.air.q_s.scale(at.geometry.chord);
        terms.add(0, Channel::Pitch, moment * alpha * alpha * alpha);
    }
}
