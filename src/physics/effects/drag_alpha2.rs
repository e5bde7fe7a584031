//! Drag that grows with the square of the angle of attack.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Induced drag proportional to the square of the angle of attack.
pub struct DragAlpha2;

impl Effect for DragAlpha2 {
    const ID: &'static str = "drag_alpha2";
    const DESCRIPTION: &'static str = "Induced drag as the square of angle of attack.";
    const FORMULA: &'static str = "D = Q CDα² α²";
    const SOURCE: &'static str = "Gryte18; BM12 section 4.2.2";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("CDalpha2", "drag due to the square of incidence", "1/rad²", (0.0, 10.0))];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Drag],
        look_alikes: &["drag_elevator_abs", "drag_linear.CDalpha", "drag_linear.CD0"],
        separated_by: "push-overs and pull-ups at fixed elevator, so that incidence changes alone",
        example: &[1.5],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let q = at.air.q_s;
        terms.add(0, Channel::Drag, q * at.state.alpha * at.state.alpha);
    }
}
