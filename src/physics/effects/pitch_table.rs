//! Pitching moment from a table over the angle of attack.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// The effect `pitch_table`: the moment coefficient is a factor times a table over the angle of attack. It adds to that of
/// `pitch_linear`.
pub struct PitchTable;

impl Effect for PitchTable {
    const ID: &'static str = "pitch_table";
    const DESCRIPTION: &'static str =
        "Pitching moment as a table over angle of attack, in addition to the line of pitch_linear.";
    const FORMULA: &'static str = "m = Q c k Cm(α)";
    const SOURCE: &'static str = "Klein and Morelli, Aircraft System Identification, section 3.3";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("k", "factor on the whole table", "", (0.0, 10.0))];
    const TABLE: Option<&'static str> = Some("Cm");

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, own: Own, terms: &mut impl Terms<R>) {
        if let Some(table) = own.table {
            let moment = at.air.q_s.scale(at.geometry.chord);
            terms.add(0, Channel::Pitch, moment * table.at(at.state.alpha));
        }
    }
}
