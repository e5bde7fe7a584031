//! Dihedral effect that depends on the angle of attack, as for a swept wing.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point, State};

/// Rolling moment due to sideslip, proportional to the angle of attack.
pub struct DihedralAlpha;

impl Effect for DihedralAlpha {
    const ID: &'static str = "dihedral_alpha";
    const DESCRIPTION: &'static str =
        "The dihedral effect changes with angle of attack, as on a swept wing.";
    const FORMULA: &'static str = "l = Q b Clαβ α β";
    const SOURCE: &'static str = "Etkin and Reid, Dynamics of Flight, section 3.12: dihedral effect of sweep grows with lift";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "Clalphabeta",
        "rolling moment due to the product of incidence and sideslip",
        "1/rad²",
        (-20.0, 20.0),
    )];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Roll],
        look_alikes: &["roll_linear.Clbeta", "roll_control_alpha", "roll_linear.Clp"],
        separated_by: "skids at two angles of attack, pulse against steady roll",
        example: &[-0.8],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let State { alpha, beta, .. } = *at.state;
        terms.add(0, Channel::Roll, at.air.q_s.scale(at.geometry.span) * alpha * beta);
    }
}
