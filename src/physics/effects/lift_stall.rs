//! Stall: a transition of the lift from that of the other effects to that of a flat plate.

use super::{Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Loss of lift beyond the stall, with the transition of R. W. Beard, T. W. McLain, "Small Unmanned Aircraft", section 4.2.
pub struct LiftStall;

/// Computes e^(x · sharpness), with the exponent limited to ±40. It is a function because a closure prevents vectorisation.
#[inline(always)]
fn power<R: Real>(x: R, sharpness: f64) -> R {
    x.scale(sharpness).clamp(-40.0, 40.0).exp()
}

impl Effect for LiftStall {
    const ID: &'static str = "lift_stall";
    const DESCRIPTION: &'static str =
        "Stall: beyond an angle of attack the lift goes over to that of a flat plate.";
    const FORMULA: &'static str = "L = k σ(α; α0, M) (Q 2 sign(α) sin²α cosα − L_still)";
    const SOURCE: &'static str = "BM12 eqs. (4.9), (4.10)";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("k", "share of the lift that stalls; 1 for all of it", "", (0.0, 1.5)),
        coefficient(
            "alpha0_rad",
            "angle of attack at which half the lift has gone over",
            "rad",
            (0.05, 0.6),
        ),
        coefficient("M", "sharpness of the transition", "1/rad", (5.0, 500.0)),
    ];
    const SHAPE: usize = 2;
    const NEEDS: Needs = Needs::Parts;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Lift],
        look_alikes: &["drag_alpha2", "pitch_break", "lift_linear.CLalpha"],
        separated_by: "slow to an angle of attack well beyond the stall and push to the negative one",
        example: &[1.0, 0.2, 50.0],
        starts: &[
            &[1.0, 0.12, 50.0],
            &[1.0, 0.16, 50.0],
            &[1.0, 0.20, 50.0],
            &[1.0, 0.24, 50.0],
            &[1.0, 0.28, 50.0],
            &[1.0, 0.34, 50.0],
        ],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, own: Own, terms: &mut impl Terms<R>) {
        let &[alpha0, sharpness] = own.shape else { return };
        let alpha = at.state.alpha;
        // σ = (1 + e^−M(α−α0) + e^M(α+α0)) / ((1 + e^−M(α−α0)) (1 + e^M(α+α0))); `power` limits the exponents, so that the
        // exponentials are finite in f32
        let above = power(R::from_f64(alpha0) - alpha, sharpness);
        let below = power(R::from_f64(alpha0) + alpha, sharpness);
        let one = R::from_f64(1.0);
        let blend = (one + above + below) / ((one + above) * (one + below));
        let sign = R::where_less(alpha, R::zero(), -one, one);
        let (sin, cos) = (at.air.sin_alpha, at.air.cos_alpha);
        let plate = at.air.q_s * (sign * sin * sin * cos).scale(2.0);
        terms.add(0, Channel::Lift, blend * (plate - at.base.still.get(Channel::Lift)));
    }
}
