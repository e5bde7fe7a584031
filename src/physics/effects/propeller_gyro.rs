//! Gyroscopic reaction of the propeller.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Gyroscopic moments of a rotor whose axis is the body's x axis.
pub struct PropellerGyro;

impl Effect for PropellerGyro {
    const ID: &'static str = "propeller_gyro";
    const DESCRIPTION: &'static str = "The propeller's angular momentum couples pitch with yaw.";
    const FORMULA: &'static str = "m = h r, n = −h q";
    const SOURCE: &'static str = "M = −ω × H with H = (−h, 0, 0); BM12 section 3.3";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "h_nms",
        "angular momentum of the rotor, positive if it turns anticlockwise seen from behind",
        "N m s",
        (-10.0, 10.0),
    )];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Pitch, Channel::Yaw],
        look_alikes: &["yaw_linear.Cnp", "inertia_xz", "gyro bias"],
        separated_by: "turns and pull-ups: one h serves pitch under yaw rate and yaw under pitch rate, with opposite signs",
        example: &[0.05],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        terms.add(0, Channel::Pitch, at.state.r);
        terms.add(0, Channel::Yaw, -at.state.q);
    }
}
