//! An effect of the catalogue: thrust from a table.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::atmosphere::SEA_LEVEL_DENSITY;
use crate::{Channel, Point};

/// Thrust along body x, interpolated in a table over throttle and airspeed.
pub struct ThrustTable;

impl Effect for ThrustTable {
    const ID: &'static str = "thrust_table";
    const DESCRIPTION: &'static str =
        "Thrust along body x as a table over throttle and airspeed, in place of propeller or thrust_linear.";
    const FORMULA: &'static str = "T = ρ/ρ0 k T(δt, V), ρ0 = 1.225 kg/m³";
    const SOURCE: &'static str =
        "a wind tunnel's, a simulator's or a maker's table; bilinear between its points";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("k", "factor on the whole table", "", (0.0, 10.0))];
    const GRID: Option<&'static str> = Some("T_n");

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, own: Own, terms: &mut impl Terms<R>) {
        if let Some(grid) = own.grid {
            let share = at.air.density.scale(1.0 / SEA_LEVEL_DENSITY);
            let thrust = grid.at(at.controls.throttle, at.state.airspeed);
            terms.add(0, Channel::BodyX, share * thrust);
        }
    }
}
