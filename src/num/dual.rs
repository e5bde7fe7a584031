//! Dual numbers: exact first derivatives by forward-mode differentiation.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::{Real, each};

/// A value with its gradient with respect to `N` inputs.
///
/// The scalar type `T` is generic, so that SIMD vectors ([`Lanes`](super::Lanes)) can have gradients too. The crate `num-dual`
/// is not used, because it needs scalars that can be compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const N: usize, T = f64> {
    /// Value of the function.
    pub value: T,
    /// Derivatives of the function with respect to the `N` inputs.
    pub gradient: [T; N],
}

impl<const N: usize, T: Real> Dual<N, T> {
    /// The input with number `index` (from 0) and the value `value`. Its derivative with respect to itself is one.
    pub fn variable(value: T, index: usize) -> Self {
        let mut gradient = [T::zero(); N];
        gradient[index] = T::from_f64(1.0);
        Dual { value, gradient }
    }

    /// The result of applying a function to `self`, with the gradient by the chain rule. `value` and `slope` are the function's
    /// value and derivative at `self`.
    #[inline(always)]
    fn chain(self, value: T, slope: T) -> Self {
        Dual { value, gradient: each(self.gradient, |g| g * slope) }
    }
}

impl<const N: usize, T: Real> Add for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}
impl<const N: usize, T: Real> Sub for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        self -= other;
        self
    }
}
impl<const N: usize, T: Real> AddAssign for Dual<N, T> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.value += other.value;
        for (g, o) in self.gradient.iter_mut().zip(other.gradient) {
            *g += o;
        }
    }
}
impl<const N: usize, T: Real> SubAssign for Dual<N, T> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        self.value -= other.value;
        for (g, o) in self.gradient.iter_mut().zip(other.gradient) {
            *g -= o;
        }
    }
}
impl<const N: usize, T: Real> Mul for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let mut gradient = self.gradient;
        for (g, o) in gradient.iter_mut().zip(other.gradient) {
            *g = *g * other.value + o * self.value;
        }
        Dual { value: self.value * other.value, gradient }
    }
}
impl<const N: usize, T: Real> Div for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        let mut gradient = self.gradient;
        for (g, o) in gradient.iter_mut().zip(other.gradient) {
            *g = (*g - o * value) / other.value;
        }
        Dual { value, gradient }
    }
}
impl<const N: usize, T: Real> Neg for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Dual { value: -self.value, gradient: each(self.gradient, |g| -g) }
    }
}

impl<const N: usize, T: Real> Real for Dual<N, T> {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Dual { value: T::from_f64(x), gradient: [T::zero(); N] }
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let norm = self.value * self.value + x.value * x.value;
        let mut gradient = self.gradient;
        for (g, dx) in gradient.iter_mut().zip(x.gradient) {
            *g = (*g * x.value - dx * self.value) / norm;
        }
        Dual { value: self.value.atan2(x.value), gradient }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        // the infinite slope at zero is replaced by zero, because a zero gradient times ∞ would be NaN
        let slope = T::where_less(T::zero(), root, T::from_f64(0.5) / root, T::zero());
        self.chain(root, slope)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let e = self.value.exp();
        self.chain(e, e)
    }
    #[inline(always)]
    fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self {
        let mut gradient = then.gradient;
        for (t, o) in gradient.iter_mut().zip(otherwise.gradient) {
            *t = T::where_less(a.value, b.value, *t, o);
        }
        Dual { value: T::where_less(a.value, b.value, then.value, otherwise.value), gradient }
    }
    // the factor has no gradient, which saves half of the products of a multiplication
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        Dual { value: self.value.scale(factor), gradient: each(self.gradient, |g| g.scale(factor)) }
    }
    #[inline(always)]
    fn mul_add_constant(self, factor: f64, addend: Self) -> Self {
        let mut gradient = addend.gradient;
        for (sum, g) in gradient.iter_mut().zip(self.gradient) {
            *sum = g.mul_add_constant(factor, *sum);
        }
        Dual { value: self.value.mul_add_constant(factor, addend.value), gradient }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function that uses every operation and is smooth at the test point.
    fn everything<R: Real>(x: R, y: R) -> R {
        let (s, c) = (x * y).sin_cos();
        let a = s.atan2(c + R::from_f64(2.0)) + (x / y).exp() - (x * x + y * y).sqrt();
        let b = (x - y).abs() + x.min(y) * R::from_f64(3.0) + x.max(y) - s.asin();
        a * b + (-y).clamp(-0.2, 0.3) + x.scale(0.5) + (x * y).mul_add_constant(-0.7, y)
    }

    #[test]
    fn derivatives_agree_with_central_differences() {
        let (x, y, h) = (0.7, 0.4, 1e-6);
        let dual = everything(Dual::<2>::variable(x, 0), Dual::variable(y, 1));
        let dx = (everything(x + h, y) - everything(x - h, y)) / (2.0 * h);
        let dy = (everything(x, y + h) - everything(x, y - h)) / (2.0 * h);
        assert_eq!(dual.value, everything(x, y));
        // central differences with h = 1e-6 have errors of about 1e-9
        assert!((dual.gradient[0] - dx).abs() < 1e-8, "{} {dx}", dual.gradient[0]);
        assert!((dual.gradient[1] - dy).abs() < 1e-8, "{} {dy}", dual.gradient[1]);
    }

    #[test]
    fn limits_pass_the_gradient_of_the_side_that_holds() {
        let x = Dual::<1>::variable(5.0, 0);
        assert_eq!(x.clamp(-1.0, 1.0).gradient, [0.0]);
        assert_eq!(x.clamp(-9.0, 9.0).gradient, [1.0]);
        assert_eq!((-x).abs().gradient, [1.0]);
    }
}
