//! An effect of the catalogue: the linear part of the pitching moment.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Pitching moment that is linear in angle of attack, pitch rate and elevator deflection.
pub struct PitchLinear;

impl Effect for PitchLinear {
    const ID: &'static str = "pitch_linear";
    const DESCRIPTION: &'static str =
        "Pitching moment linear in angle of attack, pitch rate and elevator.";
    const FORMULA: &'static str = "m = Q c (Cm0 + Cmα α + Cmq q̂ + Cmδe δe)";
    const SOURCE: &'static str = "GSFM26 eq. (45)";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("Cm0", "pitching moment coefficient at zero incidence", "", (-0.5, 0.5)),
        coefficient("Cmalpha", "longitudinal stiffness", "1/rad", (-5.0, 3.0)),
        coefficient("Cmq", "pitch damping", "", (-100.0, 0.0)),
        coefficient("Cmde", "elevator power", "1/rad", (-8.0, 0.0)),
    ];

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let q = at.air.q_s.scale(at.geometry.chord);
        terms.add(0, Channel::Pitch, q);
        terms.add(1, Channel::Pitch, q * at.state.alpha);
        terms.add(2, Channel::Pitch, q * at.air.q_hat);
        terms.add(3, Channel::Pitch, q * at.controls.elevator);
    }
}
