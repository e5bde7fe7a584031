//! Lanes: `N` single-precision numbers that move together through the same equations.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::Real;

/// `N` values of `f32`, one per candidate of a batch.
///
/// Plain arrays and straight-line code: the compiler turns each operation into the vector
/// instructions of whatever target a kernel is compiled for, so one source serves the portable,
/// AVX2, AVX-512 and NEON builds.
///
/// With `FUSED`, [`Real::mul_add`] rounds once: twice the speed where the processor has the
/// instruction and the kernel is compiled for it, very slow elsewhere, and other last bits. Without
/// it every instruction set gives the same numbers to the bit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes<const N: usize, const FUSED: bool = false>(pub [f32; N]);

impl<const N: usize, const FUSED: bool> Lanes<N, FUSED> {
    /// The same value in every lane.
    #[inline(always)]
    pub fn splat(x: f32) -> Self {
        Lanes([x; N])
    }
}

/// `N` results of an expression in `i`. A loop rather than `std::array::from_fn`: a function that is
/// not inlined leaves the vector instructions of whoever calls it.
macro_rules! lanes {
    ($i:ident => $value:expr) => {{
        let mut all = [0.0; N];
        let mut $i = 0;
        while $i < N {
            all[$i] = $value;
            $i += 1;
        }
        Lanes(all)
    }};
}

macro_rules! operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl<const N: usize, const FUSED: bool> $trait for Lanes<N, FUSED> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                lanes!(i => self.0[i] $op other.0[i])
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl<const N: usize, const FUSED: bool> AddAssign for Lanes<N, FUSED> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
impl<const N: usize, const FUSED: bool> SubAssign for Lanes<N, FUSED> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
impl<const N: usize, const FUSED: bool> Neg for Lanes<N, FUSED> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        lanes!(i => -self.0[i])
    }
}

impl<const N: usize, const FUSED: bool> Real for Lanes<N, FUSED> {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Lanes::splat(x as f32)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        (lanes!(i => sin_cos(self.0[i]).0), lanes!(i => sin_cos(self.0[i]).1))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        lanes!(i => atan2(self.0[i], x.0[i]))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        lanes!(i => self.0[i].sqrt())
    }
    #[inline(always)]
    fn exp(self) -> Self {
        lanes!(i => exp(self.0[i]))
    }
    #[inline(always)]
    fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self {
        lanes!(i => if a.0[i] < b.0[i] { then.0[i] } else { otherwise.0[i] })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        if FUSED {
            return lanes!(i => self.0[i].mul_add(factor.0[i], addend.0[i]));
        }
        self * factor + addend
    }
}

/// Adding and subtracting 1.5 · 2²³ rounds to the nearest integer without a call.
const ROUND: f32 = 12_582_912.0;

/// Sine and cosine to 1e-7 absolute for |x| < 8192, without branches (Cephes `sinf`, `cosf`).
#[inline(always)]
fn sin_cos(x: f32) -> (f32, f32) {
    let turns = (x * std::f32::consts::FRAC_2_PI + ROUND) - ROUND;
    // π/2 in three parts, so that the reduced argument keeps its last bits
    let y = ((x - turns * 1.570_312_5) - turns * 4.837_513e-4) - turns * 7.549_79e-8;
    let quarter = turns - 4.0 * ((turns * 0.25 - 0.375 + ROUND) - ROUND); // 0..3, as a float
    let z = y * y;
    let sine = y + y * z * (-1.666_665_4e-1 + z * (8.332_161e-3 + z * -1.951_529_6e-4));
    let cosine =
        1.0 - 0.5 * z + z * z * (4.166_664_6e-2 + z * (-1.388_731_6e-3 + z * 2.443_315_7e-5));
    let odd = quarter == 1.0 || quarter == 3.0 || quarter == -1.0;
    let (s, c) = if odd { (cosine, sine) } else { (sine, cosine) };
    let s = if quarter == 2.0 || quarter == 3.0 || quarter == -1.0 { -s } else { s };
    let c = if quarter == 1.0 || quarter == 2.0 { -c } else { c };
    (s, c)
}

/// The angle of the point (x, y) to 3 ulp, without branches (Cephes `atanf`).
#[inline(always)]
fn atan2(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let (big, small) = if ax > ay { (ax, ay) } else { (ay, ax) };
    let ratio = small / if big > 1e-37 { big } else { 1e-37 };
    // tan(π/8): above it, atan(t) = π/4 + atan((t − 1)/(t + 1))
    let high = ratio > 0.414_213_57;
    let t = if high { (ratio - 1.0) / (ratio + 1.0) } else { ratio };
    let z = t * t;
    let mut angle =
        t + t * z * (-0.333_329_5 + z * (0.199_777_11 + z * (-0.138_776_85 + z * 0.080_537_45)));
    angle += if high { std::f32::consts::FRAC_PI_4 } else { 0.0 };
    angle = if ay > ax { std::f32::consts::FRAC_PI_2 - angle } else { angle };
    angle = if x < 0.0 { std::f32::consts::PI - angle } else { angle };
    if y < 0.0 { -angle } else { angle }
}

/// The exponential to 2 ulp, saturating at the ends of the range (Cephes `expf`).
#[inline(always)]
fn exp(x: f32) -> f32 {
    let x = if x > 88.0 { 88.0 } else { x };
    let x = if x < -87.0 { -87.0 } else { x };
    let n = (x * std::f32::consts::LOG2_E + ROUND) - ROUND;
    let r = (x - n * 0.693_359_4) + n * 2.121_944_4e-4;
    let p = 1.987_569_1e-4;
    let p = p * r + 1.398_199_9e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 1.666_666_5e-1;
    let p = p * r + 0.5;
    let mantissa = p * r * r + r + 1.0;
    mantissa * f32::from_bits(((n as i32 + 127) << 23) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_agree_with_the_standard_library() {
        // 1e-6 is eight units in the last place at one: three times the routines' stated error
        for i in -40_000..=40_000_i32 {
            let x = i as f32 * 2.5e-4;
            let (s, c) = sin_cos(x);
            assert!((s as f64 - (x as f64).sin()).abs() < 1e-6, "sin {x}: {s}");
            assert!((c as f64 - (x as f64).cos()).abs() < 1e-6, "cos {x}: {c}");
            assert!((exp(x) as f64 / (x as f64).exp() - 1.0).abs() < 1e-6, "exp {x}");
            let (y, x) = ((x * 7.0).sin(), (x * 3.0).cos());
            assert!(
                (atan2(y, x) as f64 - (y as f64).atan2(x as f64)).abs() < 1e-6,
                "atan2 {y} {x}"
            );
        }
        assert_eq!(atan2(0.0, 0.0), 0.0);
    }
}
