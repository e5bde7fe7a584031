//! SIMD registers of the processor and the operations on them. A register has several lanes, each with one number.

use std::fmt::Debug;

/// The constant 1.5 · 2²³. Adding it to a number and then subtracting it rounds the number to the nearest integer, without a
/// function call. The last bits of the sum are those of the integer.
pub(super) const ROUND: f32 = 12_582_912.0;

/// Single-precision numbers that one instruction processes together. Each operation rounds once as in IEEE 754, so that all
/// kinds of registers give bit-identical results.
///
/// The registers of an instruction set may be used only in functions that are compiled for this set.
pub trait Register: Copy + Debug + Send + Sync + 'static {
    /// Number of lanes of the register.
    const LANES: usize;
    /// Number of sums that a matrix product computes at the same time. It is large enough to hide the latency of a multiply-add
    /// and small enough to leave registers for the operands.
    const SUMS: usize;
    /// The same number in every lane.
    fn splat(x: f32) -> Self;
    /// Loads the first numbers of `from`, one per lane.
    fn read(from: &[f32]) -> Self;
    /// Stores the lanes at the start of `to`.
    fn write(self, to: &mut [f32]);
    /// Sum of the numbers in each lane.
    fn add(self, other: Self) -> Self;
    /// Difference of the numbers in each lane.
    fn sub(self, other: Self) -> Self;
    /// Product of the numbers in each lane.
    fn mul(self, other: Self) -> Self;
    /// Quotient of the numbers in each lane.
    fn div(self, other: Self) -> Self;
    /// Negates `self` in every lane.
    fn neg(self) -> Self;
    /// Absolute value of `self` in every lane.
    fn abs(self) -> Self;
    /// Square root of every lane.
    fn sqrt(self) -> Self;
    /// `self · factor + addend`, rounded once.
    fn fused(self, factor: Self, addend: Self) -> Self;
    /// The smaller number in each lane: `self < other ? self : other`.
    fn lesser(self, other: Self) -> Self;
    /// The larger number in each lane: `self > other ? self : other`.
    fn greater(self, other: Self) -> Self;
    /// In each lane: `a < b ? then : otherwise`.
    fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self;
    /// Sine and cosine of an angle plus n quarter turns, from the `sine` and `cosine` of the angle. `shifted` is n + 1.5 · 2²³,
    /// whose last bits are those of n.
    fn quarters(shifted: Self, sine: Self, cosine: Self) -> (Self, Self);
    /// The power 2ⁿ of an integer n in −126..=127.
    fn power(n: Self) -> Self;
    /// Sum over the lanes. The upper half of the lanes is added to the lower half until one lane is left.
    fn sum(self) -> f32;
}

/// An array with the value of an expression for each index from 0 to `N` − 1. It is a loop because `std::array::from_fn` might
/// not be inlined, and would then be compiled without the caller's vector instructions.
macro_rules! entries {
    ($i:ident => $value:expr) => {{
        let mut all = [0.0; N];
        let mut $i = 0;
        while $i < N {
            all[$i] = $value;
            $i += 1;
        }
        all
    }};
}

/// An array of numbers, which the compiler vectorises.
impl<const N: usize> Register for [f32; N] {
    const LANES: usize = N;
    // six sums of 16 lanes use 24 of NEON's 32 registers
    const SUMS: usize = 6;
    #[inline(always)]
    fn splat(x: f32) -> Self {
        [x; N]
    }
    #[inline(always)]
    fn read(from: &[f32]) -> Self {
        let mut all = [0.0; N];
        all.copy_from_slice(&from[..N]);
        all
    }
    #[inline(always)]
    fn write(self, to: &mut [f32]) {
        to[..N].copy_from_slice(&self);
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        entries!(i => self[i] + other[i])
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        entries!(i => self[i] - other[i])
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        entries!(i => self[i] * other[i])
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        entries!(i => self[i] / other[i])
    }
    #[inline(always)]
    fn neg(self) -> Self {
        entries!(i => -self[i])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        entries!(i => self[i].abs())
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        entries!(i => self[i].sqrt())
    }
    #[inline(always)]
    fn fused(self, factor: Self, addend: Self) -> Self {
        entries!(i => self[i].mul_add(factor[i], addend[i]))
    }
    #[inline(always)]
    fn lesser(self, other: Self) -> Self {
        entries!(i => if self[i] < other[i] { self[i] } else { other[i] })
    }
    #[inline(always)]
    fn greater(self, other: Self) -> Self {
        entries!(i => if self[i] > other[i] { self[i] } else { other[i] })
    }
    #[inline(always)]
    fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self {
        entries!(i => if a[i] < b[i] { then[i] } else { otherwise[i] })
    }
    #[inline(always)]
    fn quarters(shifted: Self, sine: Self, cosine: Self) -> (Self, Self) {
        let odd = |i: usize| shifted[i].to_bits() & 1 == 1;
        let s = entries!(i => if odd(i) { cosine[i] } else { sine[i] });
        let c = entries!(i => if odd(i) { sine[i] } else { cosine[i] });
        let sign = |n: u32| (n & 2) << 30;
        (
            entries!(i => f32::from_bits(s[i].to_bits() ^ sign(shifted[i].to_bits()))),
            entries!(i => f32::from_bits(c[i].to_bits() ^ sign(shifted[i].to_bits().wrapping_add(1)))),
        )
    }
    #[inline(always)]
    fn power(n: Self) -> Self {
        entries!(i => f32::from_bits(((n[i] as i32).wrapping_add(127) << 23) as u32))
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        let (mut x, mut half) = (self, N / 2);
        while half > 0 {
            let mut i = 0;
            while i < half {
                x[i] += x[i + half];
                i += 1;
            }
            half /= 2;
        }
        x[0]
    }
}

/// Two registers. The lanes of the first precede those of the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair<V>(V, V);

/// Implements operations of [`Pair`] by the same operation on each of its two registers.
macro_rules! halves {
    ($($method:ident($($other:ident),*)),*) => {$(
        #[inline(always)]
        fn $method(self, $($other: Self),*) -> Self {
            Pair(self.0.$method($($other.0),*), self.1.$method($($other.1),*))
        }
    )*};
}

impl<V: Register> Register for Pair<V> {
    const LANES: usize = 2 * V::LANES;
    const SUMS: usize = V::SUMS / 2;
    halves!(
        add(other),
        sub(other),
        mul(other),
        div(other),
        neg(),
        abs(),
        sqrt(),
        fused(factor, addend),
        lesser(other),
        greater(other)
    );
    #[inline(always)]
    fn splat(x: f32) -> Self {
        let half = V::splat(x);
        Pair(half, half)
    }
    #[inline(always)]
    fn read(from: &[f32]) -> Self {
        Pair(V::read(from), V::read(&from[V::LANES..]))
    }
    #[inline(always)]
    fn write(self, to: &mut [f32]) {
        self.0.write(to);
        self.1.write(&mut to[V::LANES..]);
    }
    #[inline(always)]
    fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self {
        let first = V::where_less(a.0, b.0, then.0, otherwise.0);
        Pair(first, V::where_less(a.1, b.1, then.1, otherwise.1))
    }
    #[inline(always)]
    fn quarters(shifted: Self, sine: Self, cosine: Self) -> (Self, Self) {
        let (s, c) = V::quarters(shifted.0, sine.0, cosine.0);
        let (t, d) = V::quarters(shifted.1, sine.1, cosine.1);
        (Pair(s, t), Pair(c, d))
    }
    #[inline(always)]
    fn power(n: Self) -> Self {
        Pair(V::power(n.0), V::power(n.1))
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        self.0.add(self.1).sum()
    }
}

/// Implements the operations of [`Register`] for which the intrinsics of all instruction sets differ only in their names.
#[cfg(target_arch = "x86_64")]
macro_rules! intrinsics {
    ($register:ty, $lanes:literal, $sums:literal, $add:ident $sub:ident $mul:ident $div:ident $min:ident $max:ident
     $sqrt:ident $splat:ident $load:ident $store:ident) => {
        const LANES: usize = $lanes;
        const SUMS: usize = $sums;
        intrinsics!(two $register, add $add, sub $sub, mul $mul, div $div, lesser $min, greater $max);
        #[inline(always)]
        fn splat(x: f32) -> Self {
            // SAFETY: as the trait requires, the processor has the instruction
            unsafe { $splat(x) }
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: as the trait requires, the processor has the instruction
            unsafe { $sqrt(self) }
        }
        #[inline(always)]
        fn read(from: &[f32]) -> Self {
            let from = &from[..$lanes];
            // SAFETY: the processor has the instruction, and `from` has as many numbers as are read
            unsafe { $load(from.as_ptr()) }
        }
        #[inline(always)]
        fn write(self, to: &mut [f32]) {
            let to = &mut to[..$lanes];
            // SAFETY: the processor has the instruction, and `to` has room for as many numbers as are written
            unsafe { $store(to.as_mut_ptr(), self) }
        }
    };
    (two $register:ty, $($method:ident $intrinsic:ident),*) => {$(
        #[inline(always)]
        fn $method(self, other: Self) -> Self {
            // SAFETY: as the trait requires, the processor has the instruction
            unsafe { $intrinsic(self, other) }
        }
    )*};
}

#[cfg(target_arch = "x86_64")]
mod x86;
