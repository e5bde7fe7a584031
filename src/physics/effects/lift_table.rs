//! Lift from a table over the angle of attack, including the stall.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Lift as a table over angle of attack, including the stall.
pub struct LiftTable;

impl Effect for LiftTable {
    const ID: &'static str = "lift_table";
    const DESCRIPTION: &'static str = "Lift as a table over angle of attack, stall included.";
    const FORMULA: &'static str = "L = Q k CL(α)";
    const SOURCE: &'static str = "tables of JSBSim's X8, see params/x8/FACTS.md";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("k", "factor on the whole table", "", (0.0, 10.0))];
    const TABLE: Option<&'static str> = Some("CL");

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, own: Own, terms: &mut impl Terms<R>) {
        if let Some(table) = own.table {
            terms.add(0, Channel::Lift, at.air.q_s * table.at(at.state.alpha));
        }
    }
}
