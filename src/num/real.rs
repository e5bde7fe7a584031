//! The trait `Real`: the operations that an equation of motion may use.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// The scalar type of the physics: `f64`, [`Lanes`](super::Lanes) of `f32`, or [`Dual`](super::Dual) numbers.
///
/// There is no `<`, because lanes cannot branch. Equations use [`where_less`](Real::where_less), [`min`](Real::min),
/// [`max`](Real::max), [`abs`](Real::abs) and [`Table`](super::Table) instead.
pub trait Real:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// Number of outputs of a network layer that are summed at the same time, in registers.
    const ABREAST: usize = 6;
    /// Whether a call that is not inlined would leave the caller's vector instruction set.
    const IN_REGISTERS: bool = false;

    /// The constant `x` in every lane, with zero derivatives.
    fn from_f64(x: f64) -> Self;
    /// Sine and cosine of an angle in rad.
    fn sin_cos(self) -> (Self, Self);
    /// The angle of the point (`x`, `self`), −π..π rad.
    fn atan2(self, x: Self) -> Self;
    /// Square root of the number.
    fn sqrt(self) -> Self;
    /// The exponential function e^x.
    fn exp(self) -> Self;
    /// `then` if `a < b`, else `otherwise`. Both are computed.
    fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self;

    /// Magnitude (absolute value) of the number.
    #[inline(always)]
    fn abs(self) -> Self {
        Self::where_less(self, Self::zero(), -self, self)
    }
    /// The smaller of two numbers. If `self` is NaN, the result is NaN, because a limit must not hide a NaN.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::where_less(other, self, other, self)
    }
    /// The larger of two numbers. If `self` is NaN, the result is NaN.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::where_less(self, other, other, self)
    }
    /// Multiply-add `self · factor + addend`. The type determines whether the result is rounded once or twice.
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }
    /// Multiply-add with a constant factor, `self · factor + addend`, rounded like [`mul_add`](Real::mul_add).
    #[inline(always)]
    fn mul_add_constant(self, factor: f64, addend: Self) -> Self {
        self.mul_add(Self::from_f64(factor), addend)
    }
    /// The constant zero.
    #[inline(always)]
    fn zero() -> Self {
        Self::from_f64(0.0)
    }
    /// `self` multiplied by a constant.
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self * Self::from_f64(factor)
    }
    /// `self` limited to `low..=high`.
    #[inline(always)]
    fn clamp(self, low: f64, high: f64) -> Self {
        self.max(Self::from_f64(low)).min(Self::from_f64(high))
    }
    /// The hyperbolic tangent, with an absolute error of 1e-7 in single precision.
    #[inline(always)]
    fn tanh(self) -> Self {
        let one = Self::from_f64(1.0);
        // beyond ±20 the hyperbolic tangent is ±1 even in double precision; the limit keeps the exponential finite
        let e = self.clamp(-20.0, 20.0).scale(2.0).exp();
        (e - one) / (e + one)
    }
    /// The inverse sine, for arguments in −1..1.
    #[inline(always)]
    fn asin(self) -> Self {
        let one = Self::from_f64(1.0);
        self.atan2(((one - self) * (one + self)).max(Self::zero()).sqrt())
    }
}

/// Applies `f` to every element. The function is always inlined, unlike the `map` of an array. A call would be compiled without
/// the caller's vector instructions.
#[inline(always)]
pub fn each<const N: usize, T: Copy, S: Copy>(all: [T; N], mut f: impl FnMut(T) -> S) -> [S; N] {
    let mut out = [f(all[0]); N];
    let mut i = 1;
    while i < N {
        out[i] = f(all[i]);
        i += 1;
    }
    out
}

impl Real for f64 {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        f64::sin_cos(self)
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        f64::atan2(self, x)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        f64::exp(self)
    }
    #[inline(always)]
    fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self {
        if a < b { then } else { otherwise }
    }
}
