//! Thrust that is not proportional to the throttle.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Makes the thrust quadratic in throttle, as for a motor whose voltage is proportional to the throttle. The added thrust
/// is zero without throttle and at full throttle.
pub struct ThrottleCurve;

impl Effect for ThrottleCurve {
    const ID: &'static str = "throttle_curve";
    const DESCRIPTION: &'static str =
        "The thrust bends over the throttle; without and at full throttle it stays.";
    const FORMULA: &'static str = "T += Tb δt (δt − 1)";
    const SOURCE: &'static str =
        "thrust is proportional to the square of a propeller's speed, and that to the voltage: BM12 section 4.3";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "Tb_n",
        "four times the thrust missing at half throttle",
        "N",
        (-1e4, 1e4),
    )];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::BodyX],
        look_alikes: &["thrust_scale", "thrust_linear.Cp_n", "drag_linear.CD0"],
        separated_by: "throttle steps of several sizes at one airspeed",
        example: &[26.0],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let throttle = at.controls.throttle;
        terms.add(0, Channel::BodyX, throttle * (throttle - R::from_f64(1.0)));
    }
}
