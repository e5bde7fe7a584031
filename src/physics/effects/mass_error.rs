//! Mass that differs from the model's.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::rigid_body::RigidBody;
use crate::{Channel, Point};

/// Relative change of the mass. The gravitational acceleration, moments of inertia and forces are unchanged.
pub struct MassError;

impl Effect for MassError {
    const ID: &'static str = "mass_error";
    const DESCRIPTION: &'static str = "The aircraft is heavier than the model says.";
    const FORMULA: &'static str = "acceleration = F / (m (1 + k)) + g";
    const SOURCE: &'static str = "Newton; moments of inertia as they are";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("k", "share by which the mass exceeds that of the model", "", (-0.5, 1.0))];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Drag, Channel::Lift, Channel::Side, Channel::BodyX],
        look_alikes: &["air_density", "external_load", "thrust_scale"],
        separated_by: "throttle steps and pull-ups: thrust too moves a heavier aircraft less, while moments stay",
        example: &[0.25],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(_: &Point<R>, _: Own, _: &mut impl Terms<R>) {}

    fn change(coefficients: &[f64], body: &mut RigidBody) {
        body.mass *= 1.0 + coefficients[0];
    }
}
