//! An effect of the catalogue: the linear part of the drag.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Drag that is linear in angle of attack, pitch rate and elevator deflection.
pub struct DragLinear;

impl Effect for DragLinear {
    const ID: &'static str = "drag_linear";
    const DESCRIPTION: &'static str = "Drag linear in angle of attack, pitch rate and elevator.";
    const FORMULA: &'static str = "D = Q (CD0 + CDα α + CDq q̂ + CDδe δe)";
    const SOURCE: &'static str = "GSFM26 eq. (40)";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("CD0", "drag coefficient at zero incidence", "", (0.0, 0.5)),
        coefficient("CDalpha", "drag slope", "1/rad", (-1.0, 1.0)),
        coefficient("CDq", "drag due to pitch rate", "", (-5.0, 5.0)),
        coefficient("CDde", "drag due to signed elevator", "1/rad", (-0.5, 0.5)),
    ];

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let q = at.air.q_s;
        terms.add(0, Channel::Drag, q);
        terms.add(1, Channel::Drag, q * at.state.alpha);
        terms.add(2, Channel::Drag, q * at.air.q_hat);
        terms.add(3, Channel::Drag, q * at.controls.elevator);
    }
}
