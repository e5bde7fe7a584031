//! Reaction torque of the propeller on the airframe.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Adds a rolling moment that is proportional to the throttle. A positive coefficient rolls to the left.
pub struct MotorTorque;

impl Effect for MotorTorque {
    const ID: &'static str = "motor_torque";
    const DESCRIPTION: &'static str =
        "The airframe rolls against the torque that turns the propeller.";
    const FORMULA: &'static str = "l = −k δt";
    const SOURCE: &'static str =
        "BM12 section 4.3; reaction of the propeller, to first order in throttle";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "k_nm",
        "rolling moment at full throttle, to the left",
        "N m",
        (-50.0, 50.0),
    )];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Roll],
        look_alikes: &["asymmetry", "roll_linear.Cl0"],
        separated_by: "throttle steps at fixed airspeed: an asymmetry is independent of the throttle",
        example: &[0.5],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        terms.add(0, Channel::Roll, -at.controls.throttle);
    }
}
