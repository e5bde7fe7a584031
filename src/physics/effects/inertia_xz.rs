//! Effect of a product of inertia Jxz that differs from the model's.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::rigid_body::RigidBody;
use crate::{Channel, Point};

/// Adds the coefficient `dJxz_kgm2` to the model's product of inertia Jxz.
pub struct InertiaXz;

impl Effect for InertiaXz {
    const ID: &'static str = "inertia_xz";
    const DESCRIPTION: &'static str = "The product of inertia Jxz differs from the model's.";
    const FORMULA: &'static str = "l = ΔJxz (ṙ + pq), n = ΔJxz (ṗ − qr), m = −ΔJxz (p² − r²)";
    const SOURCE: &'static str = "BM12 section 3.3, −Jxz in the inertia matrix";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("dJxz_kgm2", "addition to the product of inertia", "kg m²", (-10.0, 10.0))];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Roll, Channel::Pitch, Channel::Yaw],
        look_alikes: &["yaw_linear.Cnda", "yaw_linear.Cnp", "roll_linear.Clr"],
        separated_by: "fast rolls to both sides",
        example: &[0.3],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(_: &Point<R>, _: Own, _: &mut impl Terms<R>) {}

    fn change(coefficients: &[f64], body: &mut RigidBody) {
        body.jxz += coefficients[0];
    }
}
