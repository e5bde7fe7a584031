//! Asymmetry of the airframe between left and right.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Constant coefficients of rolling moment, yawing moment and side force.
pub struct Asymmetry;

impl Effect for Asymmetry {
    const ID: &'static str = "asymmetry";
    const DESCRIPTION: &'static str = "The airframe is bent: it rolls, yaws and sideslips without a command.";
    const FORMULA: &'static str = "l = Q b Cl0, n = Q b Cn0, Y = Q CY0";
    const SOURCE: &'static str = "GSFM26 eqs. (42), (44), (46)";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient(
            "Cl0",
            "rolling moment coefficient of the symmetric condition",
            "",
            (-0.1, 0.1),
        ),
        coefficient("Cn0", "yawing moment coefficient of the symmetric condition", "", (-0.1, 0.1)),
        coefficient("CY0", "side force coefficient of the symmetric condition", "", (-0.5, 0.5)),
    ];
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Roll, Channel::Yaw, Channel::Side],
        look_alikes: &[
            "motor_torque",
            "roll_linear.Cl0",
            "yaw_linear.Cn0",
            "side_force_linear.CY0",
            "beta_bias",
        ],
        separated_by: "throttle steps at several airspeeds: it grows with V² and is independent of the throttle",
        example: &[0.004, 0.004, 0.004],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let (force, moment) = (at.air.q_s, at.air.q_s.scale(at.geometry.span));
        terms.add(0, Channel::Roll, moment);
        terms.add(1, Channel::Yaw, moment);
        terms.add(2, Channel::Side, force);
    }
}
