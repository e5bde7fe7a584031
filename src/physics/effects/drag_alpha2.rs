//! Drag that grows with the square of incidence.

use super::{Coefficient, Effect, Own, coefficient};
use crate::num::Real;
use crate::physics::{Channel, Point};

/// Induced drag as the square of angle of attack.
pub struct DragAlpha2;

impl Effect for DragAlpha2 {
    const ID: &'static str = "drag_alpha2";
    const DESCRIPTION: &'static str = "Induced drag as the square of angle of attack.";
    const FORMULA: &'static str = "D = Q CDα² α²";
    const SOURCE: &'static str = "Gryte18; BM12 section 4.2.2";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("CDalpha2", "drag due to the square of incidence, 1/rad²", (0.0, 10.0)),
    ];

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, mut term: impl FnMut(usize, Channel, R),
    ) {
        let q = at.air.q_s;
        term(0, Channel::Drag, q * at.state.alpha * at.state.alpha);
    }
}
