//! Thrust that decreases with airspeed.

use super::{Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point, State};

/// Airspeed at which the thrust is unchanged, m/s: that of `State::NEUTRAL`.
const V0: f64 = State::NEUTRAL.airspeed;

/// Change of thrust that is linear in airspeed, as for a fixed-pitch propeller.
pub struct ThrustDecay;

impl Effect for ThrustDecay {
    const ID: &'static str = "thrust_decay";
    const DESCRIPTION: &'static str =
        "The thrust falls with airspeed, as that of a propeller of fixed pitch.";
    const FORMULA: &'static str = "T → T (1 − k (V/V0 − 1)), V0 = 16.67 m/s";
    const SOURCE: &'static str = "CT(J) of a propeller to first order: BM12 section 4.3";
    const COEFFICIENTS: &'static [Coefficient] =
        &[coefficient("k", "share of the thrust lost at twice V0", "", (-3.0, 3.0))];
    const NEEDS: Needs = Needs::Base;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::BodyX],
        look_alikes: &["drag_linear.CD0", "thrust_linear.Cp_n", "thrust_scale"],
        separated_by: "throttle steps at several airspeeds: drag is independent of the throttle",
        example: &[0.6],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let excess = at.state.airspeed.scale(1.0 / V0) - R::from_f64(1.0);
        terms.add(0, Channel::BodyX, -at.base.wrench.get(Channel::BodyX) * excess);
    }
}
