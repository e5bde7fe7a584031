//! Drag from a table over the angle of attack.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// The effect `drag_table`: the drag coefficient is a factor times a table over the angle of attack.
pub struct DragTable;

impl Effect for DragTable {
    const ID: &'static str = "drag_table";
    const DESCRIPTION: &'static str = "Drag as a table over angle of attack.";
    const FORMULA: &'static str = "D = Q k CD(α)";
    const SOURCE: &'static str = "tables of JSBSim's X8, see params/x8/FACTS.md";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("k", "factor on the whole table", "", (0.0, 10.0))];
    const TABLE: Option<&'static str> = Some("CD");

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, own: Own, terms: &mut impl Terms<R>) {
        if let Some(table) = own.table {
            terms.add(0, Channel::Drag, at.air.q_s * table.at(at.state.alpha));
        }
    }
}
