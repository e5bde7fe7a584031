//! Drag that grows with sideslip.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Drag due to sideslip, by its magnitude and its square.
pub struct DragBeta2;

impl Effect for DragBeta2 {
    const ID: &'static str = "drag_beta2";
    const DESCRIPTION: &'static str = "Drag due to sideslip, by its magnitude and its square.";
    const FORMULA: &'static str = "D = Q (CDβ |β| + CDβ² β²)";
    const SOURCE: &'static str = "Gryte18; JSBSim's X8, see params/x8/FACTS.md";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("CDbeta", "drag due to the magnitude of sideslip", "1/rad", (-0.5, 0.5)),
        // may be negative in a model whose side force acts along body y instead of across the airflow: such a side force already
        // adds |CYβ| β² to the drag
        coefficient("CDbeta2", "drag due to the square of sideslip", "1/rad²", (-0.5, 5.0)),
    ];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Drag],
        look_alikes: &["drag_alpha2", "drag_linear.CD0"],
        separated_by: "skids to both sides with the wings level",
        example: &[0.0, 0.7],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let q = at.air.q_s;
        terms.add(0, Channel::Drag, q * at.state.beta.abs());
        terms.add(1, Channel::Drag, q * at.state.beta * at.state.beta);
    }
}
