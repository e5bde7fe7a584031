//! Piecewise linear curves over the angle of attack, as sums of hat functions. The coefficients are the ordinates at the
//! knots.
//!
//! Two knots are fixed at zero. Without this, the curve could represent a straight line, which the coefficients `CL0` and
//! `CLalpha` (or `CD0`) of other effects already represent.

use super::Terms;
use crate::Channel;
use greylag_num::Real;

/// First knot of the grid, degrees.
const FIRST_DEG: f64 = -8.0;
/// Distance between knots of the grid, degrees.
const SPACING_DEG: f64 = 2.0;
/// Range of angles of attack around the stall in which the knots are half as far apart, degrees.
const FINE_DEG: (f64, f64) = (10.0, 20.0);
/// Number of knots, from −8° to 30°.
const PLACES: usize = 25;
/// Indices of the knots at which a curve is zero: 0° and 4°, the ends of the usual range of flight.
const ZERO: [usize; 2] = [4, 6];

/// Coefficients of a curve: its ordinates at the knots that are not fixed at zero, with names like `CL_m8` or `CL_p20`.
macro_rules! heights {
    ($letter:literal, $bounds:expr) => {
        super::curve::heights!($letter, $bounds,
            "m8" "−8", "m6" "−6", "m4" "−4", "m2" "−2", "p2" "2", "p6" "6", "p8" "8", "p10" "10",
            "p11" "11", "p12" "12", "p13" "13", "p14" "14", "p15" "15", "p16" "16", "p17" "17",
            "p18" "18", "p19" "19", "p20" "20", "p22" "22", "p24" "24",
            "p26" "26", "p28" "28", "p30" "30")
    };
    ($letter:literal, $bounds:expr, $($name:literal $degrees:literal),*) => {
        &[$(super::coefficient(
            concat!($letter, "_", $name),
            concat!("addition to ", $letter, " at α = ", $degrees, "°"),
            "",
            $bounds,
        )),*]
    };
}
pub(super) use heights;

/// Adds one term per coefficient to `terms`: the value of its hat function at `alpha` (rad), times `amount`. Beyond the first
/// and the last knot a curve is constant.
///
/// The code of other effects is always inlined. This function is inlined only for SIMD vectors, because for other scalars it
/// would enlarge the code of every fit.
#[inline(always)]
pub(super) fn hats<R: Real>(alpha: R, amount: R, channel: Channel, terms: &mut impl Terms<R>) {
    #[inline(never)]
    fn called<R: Real>(alpha: R, amount: R, channel: Channel, terms: &mut impl Terms<R>) {
        in_line(alpha, amount, channel, terms);
    }
    if R::IN_REGISTERS {
        in_line(alpha, amount, channel, terms);
    } else {
        called(alpha, amount, channel, terms);
    }
}

#[inline(always)]
fn in_line<R: Real>(alpha: R, amount: R, channel: Channel, terms: &mut impl Terms<R>) {
    let degrees = alpha.scale(1.0_f64.to_degrees());
    let fine = degrees.clamp(FINE_DEG.0, FINE_DEG.1) - R::from_f64(FINE_DEG.0);
    let places = (degrees + fine - R::from_f64(FIRST_DEG)).scale(1.0 / SPACING_DEG);
    let place = places.clamp(0.0, (PLACES - 1) as f64);
    let (mut k, mut own) = (0, 0);
    while own < PLACES {
        if own != ZERO[0] && own != ZERO[1] {
            let away = (place - R::from_f64(own as f64)).abs();
            terms.add(k, channel, amount * (R::from_f64(1.0) - away).max(R::zero()));
            k += 1;
        }
        own += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Effect;

    const KNOTS: usize = PLACES - ZERO.len();

    struct Heights([f64; KNOTS]);

    impl Terms<f64> for Heights {
        fn add(&mut self, index: usize, _: Channel, amount: f64) {
            self.0[index] += amount;
        }
    }

    fn at(degrees: f64) -> [f64; KNOTS] {
        let mut heights = Heights([0.0; KNOTS]);
        hats(degrees.to_radians(), 1.0, Channel::Lift, &mut heights);
        heights.0
    }

    #[test]
    fn hats_share_the_way_between_knots_and_end_level() {
        let names = super::super::LiftCurve::COEFFICIENTS.iter().map(|c| c.name);
        let names: Vec<&str> = names.collect();
        assert_eq!(names.len(), KNOTS);
        let share =
            |degrees: f64, name: &str| at(degrees)[names.iter().position(|n| *n == name).unwrap()];
        // −1° is half way between the knots −2° and 0°, and the curve is zero at 0°
        assert!((share(-1.0, "CL_m2") - 0.5).abs() < 1e-12);
        assert!((share(9.5, "CL_p10") - 0.75).abs() < 1e-12);
        assert!((share(10.5, "CL_p10") - 0.5).abs() < 1e-12 && share(11.5, "CL_p10") == 0.0);
        assert!((share(19.5, "CL_p20") - 0.5).abs() < 1e-12);
        assert!((share(21.0, "CL_p20") - 0.5).abs() < 1e-12);
        let all = |degrees: f64| at(degrees).iter().sum::<f64>();
        for (degrees, sum) in
            [(-30.0, 1.0), (-1.0, 0.5), (0.0, 0.0), (3.5, 0.25), (4.0, 0.0), (90.0, 1.0)]
        {
            assert!((all(degrees) - sum).abs() < 1e-12, "{degrees}");
        }
        assert_eq!(share(90.0, "CL_p30"), 1.0);
    }
}
