//! Ground effect: more lift and less drag within one span of the ground.

use super::{Coefficient, Effect, Entry, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Lift slope that increases and induced drag that decreases towards the ground.
///
/// A model gets the altitude above sea level but not the height of the terrain. The ground's altitude `ground_m` is therefore a
/// constant of the effect, and the effect is valid only over flat ground such as an airfield. `ground_m` must be given, because
/// logs contain no height above ground. A few spans above the ground, the effect is negligible.
pub struct GroundEffect;

impl Effect for GroundEffect {
    const ID: &'static str = "ground_effect";
    const DESCRIPTION: &'static str =
        "Within a span of the ground, lift grows with incidence and induced drag falls.";
    const FORMULA: &'static str = "L = Q CLα,g α e^(−h/b), D = −Q CDα²,g α² e^(−h/b); h the altitude above ground_m, at least 0";
    const SOURCE: &'static str = "one exponential in h/b; cf. Phillips and Hunsaker, Lifting-line predictions for induced drag and lift in ground effect, J. Aircraft 50(4), 2013";
    const COEFFICIENTS: &'static [Coefficient] = &[
        coefficient("CLalpha", "lift slope gained at the ground", "1/rad", (0.0, 5.0)),
        coefficient(
            "CDalpha2",
            "induced drag lost at the ground, by the square of incidence",
            "1/rad²",
            (0.0, 5.0),
        ),
        coefficient(
            "ground_m",
            "altitude of the ground above mean sea level",
            "m",
            (-500.0, 9000.0),
        )
        .of_any_size(),
    ];
    const SHAPE: usize = 1;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Lift, Channel::Drag],
        look_alikes: &["lift_linear.CLalpha", "drag_alpha2", "air_density"],
        separated_by: "level passes at heights of a tenth of the span and of three spans; above one span nothing is to be seen",
        example: &[1.0, 1.0, 599.0],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, own: Own, terms: &mut impl Terms<R>) {
        let &[ground] = own.shape else { return };
        let height = (at.air.altitude - ground).max(0.0);
        let share = (-height / at.geometry.span).exp();
        let alpha = at.state.alpha;
        let force = at.air.q_s.scale(share) * alpha;
        terms.add(0, Channel::Lift, force);
        terms.add(1, Channel::Drag, -force * alpha);
    }
}
