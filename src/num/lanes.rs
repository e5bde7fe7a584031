//! SIMD lanes: single-precision numbers that one instruction evaluates together.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

#[cfg(target_arch = "x86_64")]
use super::Pair;
use super::Real;
use super::register::{ROUND, Register};
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__m128, __m256, __m512};

/// `N` lanes in registers of the type `V`. Each lane belongs to one member of a batch, such as an aircraft.
///
/// With an array (`V = [f32; N]`) the compiler vectorises the operations, but its AVX-512 code is slow. With the registers of
/// an instruction set, each operation is an intrinsic.
///
/// With `FUSED`, [`Real::mul_add`] rounds only once, which changes the last bits of results. `FUSED` doubles the speed if
/// the processor has the instruction and the kernel is compiled for it. Otherwise it is very slow. Without `FUSED`, all
/// kinds of lanes give bit-identical results.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes<const N: usize, const FUSED: bool = false, V = [f32; N]>(pub V);

/// Sixteen lanes in an AVX-512 register.
#[cfg(target_arch = "x86_64")]
pub type Avx512<const FUSED: bool> = Lanes<16, FUSED, __m512>;
/// Sixteen lanes in AVX2 registers.
#[cfg(target_arch = "x86_64")]
pub type Avx2<const FUSED: bool> = Lanes<16, FUSED, Pair<__m256>>;
/// Sixteen lanes in SSE2 registers, which every x86-64 processor has.
#[cfg(target_arch = "x86_64")]
pub type Base<const FUSED: bool> = Lanes<16, FUSED, Pair<Pair<__m128>>>;
/// Sixteen lanes as an array.
#[cfg(not(target_arch = "x86_64"))]
pub type Base<const FUSED: bool> = Lanes<16, FUSED>;

/// Whether every processor of the target architecture has a fused multiply-add.
pub const BASE_FUSED: bool = cfg!(target_arch = "aarch64");

impl<const N: usize, const FUSED: bool> Lanes<N, FUSED> {
    /// The same value in every lane.
    #[inline(always)]
    pub fn splat(x: f32) -> Self {
        Lanes([x; N])
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<const N: usize, const FUSED: bool, V: Register> $trait for Lanes<N, FUSED, V> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Lanes(V::$method(self.0, other.0))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<const N: usize, const FUSED: bool, V: Register> AddAssign for Lanes<N, FUSED, V> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
impl<const N: usize, const FUSED: bool, V: Register> SubAssign for Lanes<N, FUSED, V> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
impl<const N: usize, const FUSED: bool, V: Register> Neg for Lanes<N, FUSED, V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Lanes(self.0.neg())
    }
}

impl<const N: usize, const FUSED: bool, V: Register> Real for Lanes<N, FUSED, V> {
    const ABREAST: usize = V::SUMS;
    const IN_REGISTERS: bool = true;

    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Lanes(V::splat(x as f32))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = sin_cos(self.0);
        (Lanes(s), Lanes(c))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        Lanes(atan2(self.0, x.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Lanes(self.0.sqrt())
    }
    #[inline(always)]
    fn exp(self) -> Self {
        Lanes(exp(self.0))
    }
    #[inline(always)]
    fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self {
        Lanes(V::where_less(a.0, b.0, then.0, otherwise.0))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        if FUSED {
            return Lanes(self.0.fused(factor.0, addend.0));
        }
        self * factor + addend
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Lanes(self.0.abs())
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Lanes(other.0.lesser(self.0))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Lanes(other.0.greater(self.0))
    }
}

impl<const N: usize, const FUSED: bool, V: Register> Lanes<N, FUSED, V> {
    /// Sum over the lanes, where N must be a power of two. The upper half is repeatedly added to the lower half. All kinds of
    /// registers therefore give a bit-identical result.
    #[inline(always)]
    pub fn sum(self) -> f32 {
        self.0.sum()
    }
}

/// Lanes that can be accessed in rows of [`ROW`] lanes.
pub trait Packed: Real {
    /// Number of rows in the lanes.
    const ROWS: usize;
    /// Packs the rows `row(0)`, `row(1)`, …
    fn pack(row: impl FnMut(usize) -> [f32; ROW]) -> Self;
    /// Extracts the row with number `row`.
    fn unpack(self, row: usize) -> [f32; ROW];
}

/// Number of lanes in a row.
pub const ROW: usize = 16;

impl<const N: usize, const FUSED: bool, V: Register> Packed for Lanes<N, FUSED, V> {
    const ROWS: usize = N / ROW;

    #[inline(always)]
    fn pack(mut row: impl FnMut(usize) -> [f32; ROW]) -> Self {
        let mut from = [0.0; N];
        let mut r = 0;
        while r < Self::ROWS {
            from[r * ROW..(r + 1) * ROW].copy_from_slice(&row(r));
            r += 1;
        }
        Lanes(V::read(&from))
    }

    #[inline(always)]
    fn unpack(self, row: usize) -> [f32; ROW] {
        let (mut all, mut to) = ([0.0; N], [0.0; ROW]);
        self.0.write(&mut all);
        to.copy_from_slice(&all[row * ROW..(row + 1) * ROW]);
        to
    }
}

/// Sine and cosine with an absolute error of 1e-7 for |x| < 8192, without branches (Cephes `sinf`, `cosf`).
#[inline(always)]
fn sin_cos<V: Register>(x: V) -> (V, V) {
    let c = V::splat;
    let shifted = x.mul(c(std::f32::consts::FRAC_2_PI)).add(c(ROUND));
    let turns = shifted.sub(c(ROUND));
    // π/2 is split into three parts, which preserves the last bits of the reduced argument
    let y = x.sub(turns.mul(c(1.570_312_5))).sub(turns.mul(c(4.837_513e-4)));
    let y = y.sub(turns.mul(c(7.549_79e-8)));
    let z = y.mul(y);
    let sine = c(8.332_161e-3).add(z.mul(c(-1.951_529_6e-4)));
    let sine = y.add(y.mul(z).mul(c(-1.666_665_4e-1).add(z.mul(sine))));
    let cosine = c(-1.388_731_6e-3).add(z.mul(c(2.443_315_7e-5)));
    let cosine = z.mul(z).mul(c(4.166_664_6e-2).add(z.mul(cosine)));
    let cosine = c(1.0).sub(c(0.5).mul(z)).add(cosine);
    V::quarters(shifted, sine, cosine)
}

/// Angle of the point (x, y) with an error of 3 ulp, without branches (Cephes `atanf`).
#[inline(always)]
fn atan2<V: Register>(y: V, x: V) -> V {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    let c = V::splat;
    let (ax, ay) = (x.abs(), y.abs());
    let big = V::where_less(ay, ax, ax, ay);
    let small = V::where_less(ay, ax, ay, ax);
    let ratio = small.div(big.greater(c(1e-37)));
    // above tan(π/8), atan(t) = π/4 + atan((t − 1)/(t + 1))
    let high = c(0.414_213_57);
    let folded = ratio.sub(c(1.0)).div(ratio.add(c(1.0)));
    let t = V::where_less(high, ratio, folded, ratio);
    let z = t.mul(t);
    let series = c(-0.138_776_85).add(z.mul(c(0.080_537_45)));
    let series = c(-0.333_329_5).add(z.mul(c(0.199_777_11).add(z.mul(series))));
    let angle = t.add(t.mul(z).mul(series));
    let angle = angle.add(V::where_less(high, ratio, c(FRAC_PI_4), c(0.0)));
    let angle = V::where_less(ax, ay, c(FRAC_PI_2).sub(angle), angle);
    let angle = V::where_less(x, c(0.0), c(PI).sub(angle), angle);
    V::where_less(y, c(0.0), angle.neg(), angle)
}

/// Exponential with an error of 2 ulp, saturated at the ends of the range (Cephes `expf`).
#[inline(always)]
fn exp<V: Register>(x: V) -> V {
    let c = V::splat;
    let x = c(88.0).lesser(x);
    let x = c(-87.0).greater(x);
    let n = x.mul(c(std::f32::consts::LOG2_E)).add(c(ROUND)).sub(c(ROUND));
    let r = x.sub(n.mul(c(0.693_359_4))).add(n.mul(c(2.121_944_4e-4)));
    let p = c(1.987_569_1e-4);
    let p = p.mul(r).add(c(1.398_199_9e-3));
    let p = p.mul(r).add(c(8.333_452e-3));
    let p = p.mul(r).add(c(4.166_579_6e-2));
    let p = p.mul(r).add(c(1.666_666_5e-1));
    let p = p.mul(r).add(c(0.5));
    let mantissa = p.mul(r).mul(r).add(r).add(c(1.0));
    mantissa.mul(V::power(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_agree_with_the_standard_library() {
        // the tolerance of 1e-6 is eight units in the last place of numbers near one; the documented errors are at most three
        for i in -40_000..=40_000_i32 {
            let x = i as f32 * 2.5e-4;
            let ([s], [c]) = sin_cos([x]);
            assert!((s as f64 - (x as f64).sin()).abs() < 1e-6, "sin {x}: {s}");
            assert!((c as f64 - (x as f64).cos()).abs() < 1e-6, "cos {x}: {c}");
            assert!((exp([x])[0] as f64 / (x as f64).exp() - 1.0).abs() < 1e-6, "exp {x}");
            let (y, x) = ((x * 7.0).sin(), (x * 3.0).cos());
            assert!(
                (atan2([y], [x])[0] as f64 - (y as f64).atan2(x as f64)).abs() < 1e-6,
                "atan2 {y} {x}"
            );
        }
        assert_eq!(atan2([0.0_f32], [0.0]), [0.0]);
    }

    /// Results of every function of lanes at many arguments, as rows of lanes.
    #[inline(always)]
    fn tried<const N: usize, const FUSED: bool, V: Register>() -> Vec<[f32; ROW]> {
        let mut all = Vec::new();
        let rows = Lanes::<N, FUSED, V>::ROWS;
        for k in 0..400 {
            let row = |a: f32, b: f32| -> Lanes<N, FUSED, V> {
                Packed::pack(|_| std::array::from_fn(|i| (k * 16 + i) as f32 * a - b))
            };
            let (x, y) = (row(3.1e-3, 9.0), row(-1.7e-3, -5.3));
            let (s, c) = x.sin_cos();
            for value in [x + y, x - y, x * y, x / y, -x, s, c, y.atan2(x), x.exp(), x.tanh()] {
                all.push(value.unpack(rows - 1));
            }
            let chosen = Real::where_less(x, y, s, c);
            for value in [x.abs().sqrt(), x.min(y), x.max(y), chosen, x.mul_add(y, s)] {
                all.push(value.unpack(0));
            }
            all.push([x.sum() / rows as f32; ROW]);
        }
        let zero = Lanes::<N, FUSED, V>::zero();
        let lost = Lanes::<N, FUSED, V>::from_f64(f64::NAN);
        for value in [lost.min(zero), lost.max(zero), zero.min(lost), lost.exp()] {
            all.push(value.unpack(0).map(|x| if x.is_nan() { 7.0 } else { x }));
        }
        all
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn every_kind_of_register_gives_the_same_numbers_to_the_bit() {
        type Four = Pair<Pair<__m128>>;
        type Two = Pair<__m256>;
        #[target_feature(enable = "avx2,fma")]
        fn in_avx2() -> [Vec<[f32; ROW]>; 2] {
            [tried::<16, false, Two>(), tried::<16, true, Two>()]
        }
        #[target_feature(enable = "avx512f")]
        fn in_avx512() -> [Vec<[f32; ROW]>; 3] {
            [
                tried::<16, false, __m512>(),
                tried::<16, true, __m512>(),
                tried::<32, true, Pair<__m512>>(),
            ]
        }
        let (plain, fused) = (tried::<16, false, [f32; 16]>(), tried::<16, true, [f32; 16]>());
        assert!(plain.len() > 6000 && plain != fused);
        assert_eq!(tried::<16, false, Four>(), plain);
        assert_eq!(tried::<16, true, Four>(), fused);
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the processor has the features
            assert_eq!(unsafe { in_avx2() }, [plain.clone(), fused.clone()]);
        }
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has the feature
            assert_eq!(unsafe { in_avx512() }, [plain, fused.clone(), fused]);
        }
    }
}
