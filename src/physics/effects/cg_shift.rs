//! An effect of the catalogue: the centre of gravity lies elsewhere than the model states.

use super::{Coefficient, Effect, Entry, Needs, Own, Terms, coefficient};
use greylag_num::Real;
use crate::{Channel, Point};

/// Change of the moments if the centre of gravity lies aft of that in the model, along body x. A negative distance means that it
/// lies forward.
pub struct CgShift;

impl Effect for CgShift {
    const ID: &'static str = "cg_shift";
    const DESCRIPTION: &'static str = "The centre of gravity lies aft of where the model has it.";
    const FORMULA: &'static str = "m = −x f_z, n = x f_y; f without gravity, body axes";
    const SOURCE: &'static str =
        "r × F with r = (x, 0, 0) from the centre of gravity forward to the model's";
    const COEFFICIENTS: &'static [Coefficient] = &[coefficient(
        "x_m",
        "how far aft of the model's the centre of gravity is",
        "m",
        (-0.5, 0.5),
    )];
    const NEEDS: Needs = Needs::Base;
    const ENTRY: Option<Entry> = Some(Entry {
        channels: &[Channel::Pitch, Channel::Yaw],
        look_alikes: &["pitch_break", "pitch_linear.Cmalpha", "pitch_linear.Cm0"],
        separated_by: "a skid: the same distance acts in pitch and in yaw",
        example: &[0.02],
        starts: &[],
    });

    #[inline(always)]
    fn basis<R: Real>(at: &Point<R>, _: Own, terms: &mut impl Terms<R>) {
        let [_, y, z] = at.base.force;
        terms.add(0, Channel::Pitch, -z);
        terms.add(0, Channel::Yaw, y);
    }
}
