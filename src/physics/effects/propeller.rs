//! Thrust of a propeller as a polynomial in throttle and airspeed.

use super::{Coefficient, Effect, Own, Terms, coefficient};
use greylag_num::Real;
use crate::atmosphere::SEA_LEVEL_DENSITY;
use crate::{Channel, Point};

/// Thrust of a motor with a propeller, as a second-degree polynomial in throttle and airspeed.
///
/// The motor's voltage is taken as proportional to the throttle. The torque balance of a motor and a propeller with
/// quadratic CT(J) and CQ(J) then gives a thrust that this polynomial reproduces to 0.2 N over the envelope of an
/// Aerosonde. The polynomial includes the drag of a windmilling propeller: at low throttle the thrust is negative.
pub struct Propeller;

impl Effect for Propeller {
    const ID: &'static str = "propeller";
    const DESCRIPTION: &'static str =
        "Thrust along body x of a motor with a propeller, over throttle and airspeed.";
    const FORMULA: &'static str =
        "T = ρ/ρ0 (T0 + Tt δt + Ttt δt² + TV V + TtV δt V + TVV V²), ρ0 = 1.225 kg/m³";
    const SOURCE: &'static str = "CT(J), CQ(J) and a motor to second degree: BM12 section 4.3";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("T0_n", "thrust at rest without throttle", "N", (-1e6, 1e6)),
        coefficient("Tt_n", "slope over throttle", "N", (-1e7, 1e7)),
        coefficient("Ttt_n", "curvature over throttle", "N", (-1e7, 1e7)),
        coefficient("TV_nspm", "slope over airspeed", "N s/m", (-1e5, 1e5)),
        coefficient("TtV_nspm", "slope over airspeed that comes with throttle", "N s/m", (-1e5, 1e5)),
        coefficient("TVV_ns2pm2", "curvature over airspeed", "N s²/m²", (-1e4, 1e4)),
    ];

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let (share, v) = (at.air.density.scale(1.0 / SEA_LEVEL_DENSITY), at.state.airspeed);
        let throttled = share * at.controls.throttle;
        terms.add(0, Channel::BodyX, share);
        terms.add(1, Channel::BodyX, throttled);
        terms.add(2, Channel::BodyX, throttled * at.controls.throttle);
        terms.add(3, Channel::BodyX, share * v);
        terms.add(4, Channel::BodyX, throttled * v);
        terms.add(5, Channel::BodyX, share * v * v);
    }
}
