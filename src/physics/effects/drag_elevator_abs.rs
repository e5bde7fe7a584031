//! Drag of a deflected elevator, equal for upward and downward deflections.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Drag due to the magnitude of the elevator deflection.
pub struct DragElevatorAbs;

impl Effect for DragElevatorAbs {
    const ID: &'static str = "drag_elevator_abs";
    const DESCRIPTION: &'static str = "Drag due to the magnitude of the elevator deflection.";
    const FORMULA: &'static str = "D = Q CD|δe| |δe|, in place of Q CDδe δe";
    const SOURCE: &'static str = "JSBSim's X8, see params/x8/FACTS.md";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("CDde", "drag due to the magnitude of elevator", "1/rad", (0.0, 0.5))];
    const REPLACES: &'static [&'static str] = &["drag_linear.CDde"];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Drag],
        look_alikes: &["drag_alpha2", "drag_linear.CDde"],
        separated_by: "an elevator multisine about trim with frequencies above the short period, \
                       so that the angle of attack hardly responds",
        example: &[0.3],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let q = at.air.q_s;
        terms.add(0, Channel::Drag, q * at.controls.elevator.abs());
    }
}
