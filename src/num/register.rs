//! Registers: what lanes are kept in, and the operations that a processor has for them.

use std::fmt::Debug;

/// Adding and subtracting 1.5 · 2²³ rounds to the nearest integer without a call, and leaves the
/// integer's last bits in those of the sum.
pub(super) const ROUND: f32 = 12_582_912.0;

/// Some numbers in single precision that one instruction works on. Each operation is one rounding of
/// IEEE 754, so that all kinds of register give the same numbers to the bit.
///
/// Those of an instruction set may only be touched by functions compiled for it.
pub trait Register: Copy + Debug + Send + Sync + 'static {
    /// How many numbers it holds.
    const LANES: usize;
    /// How many may hold sums side by side, so that the latency of a multiply-add is hidden and what it
    /// takes has room.
    const SUMS: usize;
    /// The same number in every lane.
    fn splat(x: f32) -> Self;
    /// The first numbers of a list.
    fn read(from: &[f32]) -> Self;
    /// Puts the numbers at the start of a list.
    fn write(self, to: &mut [f32]);
    /// The sum.
    fn add(self, other: Self) -> Self;
    /// The difference.
    fn sub(self, other: Self) -> Self;
    /// The product.
    fn mul(self, other: Self) -> Self;
    /// The quotient.
    fn div(self, other: Self) -> Self;
    /// `self` with the other sign.
    fn neg(self) -> Self;
    /// `self` without its sign.
    fn abs(self) -> Self;
    /// The square root.
    fn sqrt(self) -> Self;
    /// `self · factor + addend`, rounded once.
    fn fused(self, factor: Self, addend: Self) -> Self;
    /// `self < other ? self : other`.
    fn lesser(self, other: Self) -> Self;
    /// `self > other ? self : other`.
    fn greater(self, other: Self) -> Self;
    /// `a < b ? then : otherwise`.
    fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self;
    /// Sine and cosine of an angle with n quarters of a turn more, n being the integer that was rounded
    /// into `shifted` by adding 1.5 · 2²³.
    fn quarters(shifted: Self, sine: Self, cosine: Self) -> (Self, Self);
    /// 2ⁿ of an integer in −126..=127.
    fn power(n: Self) -> Self;
    /// The sum of the lanes: the upper half is added to the lower one until one number is left.
    fn sum(self) -> f32;
}

/// `N` results of an expression in `i`. A loop rather than `std::array::from_fn`: a function that is not in
/// line leaves the vector instructions of whoever calls it.
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

/// Single numbers, for the compiler to make vectors of.
impl<const N: usize> Register for [f32; N] {
    const LANES: usize = N;
    // of a block of 16 lanes 24 of NEON's 32 registers
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

/// Two registers: the lanes of the first come before those of the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair<V>(V, V);

/// Operations half by half.
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

/// Implements [`Register`] by intrinsics that differ in their prefix alone.
#[cfg(target_arch = "x86_64")]
macro_rules! intrinsics {
    ($register:ty, $lanes:literal, $sums:literal, $add:ident $sub:ident $mul:ident $div:ident $min:ident $max:ident
     $sqrt:ident $splat:ident $load:ident $store:ident) => {
        const LANES: usize = $lanes;
        const SUMS: usize = $sums;
        intrinsics!(two $register, add $add, sub $sub, mul $mul, div $div, lesser $min, greater $max);
        #[inline(always)]
        fn splat(x: f32) -> Self {
            // SAFETY: as the trait demands, the processor has the instruction
            unsafe { $splat(x) }
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: as above
            unsafe { $sqrt(self) }
        }
        #[inline(always)]
        fn read(from: &[f32]) -> Self {
            let from = &from[..$lanes];
            // SAFETY: as above, and there are as many numbers as are read
            unsafe { $load(from.as_ptr()) }
        }
        #[inline(always)]
        fn write(self, to: &mut [f32]) {
            let to = &mut to[..$lanes];
            // SAFETY: as above, and there is room for as many numbers as are written
            unsafe { $store(to.as_mut_ptr(), self) }
        }
    };
    (two $register:ty, $($method:ident $intrinsic:ident),*) => {$(
        #[inline(always)]
        fn $method(self, other: Self) -> Self {
            // SAFETY: as the trait demands, the processor has the instruction
            unsafe { $intrinsic(self, other) }
        }
    )*};
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::Register;

    /// SSE2, which every such processor has.
    impl Register for __m128 {
        intrinsics!(__m128, 4, 12, _mm_add_ps _mm_sub_ps _mm_mul_ps _mm_div_ps _mm_min_ps _mm_max_ps
            _mm_sqrt_ps _mm_set1_ps _mm_loadu_ps _mm_storeu_ps);
        #[inline(always)]
        fn neg(self) -> Self {
            // SAFETY: as the trait demands; so below
            unsafe { _mm_xor_ps(self, _mm_set1_ps(-0.0)) }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            unsafe { _mm_andnot_ps(_mm_set1_ps(-0.0), self) }
        }
        /// There is no such instruction: a call for each lane.
        #[inline(always)]
        fn fused(self, factor: Self, addend: Self) -> Self {
            let (mut x, mut f, mut a) = ([0.0_f32; 4], [0.0; 4], [0.0; 4]);
            self.write(&mut x);
            factor.write(&mut f);
            addend.write(&mut a);
            for i in 0..4 {
                x[i] = x[i].mul_add(f[i], a[i]);
            }
            Self::read(&x)
        }
        #[inline(always)]
        fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self {
            unsafe { chosen(_mm_cmplt_ps(a, b), then, otherwise) }
        }
        #[inline(always)]
        fn quarters(shifted: Self, sine: Self, cosine: Self) -> (Self, Self) {
            unsafe {
                let n = _mm_castps_si128(shifted);
                let odd = _mm_castsi128_ps(_mm_srai_epi32::<31>(_mm_slli_epi32::<31>(n)));
                let two = _mm_set1_epi32(2);
                let after = _mm_add_epi32(n, _mm_set1_epi32(1));
                let s = _mm_castsi128_ps(_mm_slli_epi32::<30>(_mm_and_si128(n, two)));
                let c = _mm_castsi128_ps(_mm_slli_epi32::<30>(_mm_and_si128(after, two)));
                (_mm_xor_ps(chosen(odd, cosine, sine), s), _mm_xor_ps(chosen(odd, sine, cosine), c))
            }
        }
        #[inline(always)]
        fn power(n: Self) -> Self {
            unsafe {
                let n = _mm_add_epi32(_mm_cvttps_epi32(n), _mm_set1_epi32(127));
                _mm_castsi128_ps(_mm_slli_epi32::<23>(n))
            }
        }
        #[inline(always)]
        fn sum(self) -> f32 {
            unsafe {
                let two = _mm_add_ps(self, _mm_movehl_ps(self, self));
                _mm_cvtss_f32(_mm_add_ss(two, _mm_shuffle_ps::<1>(two, two)))
            }
        }
    }

    /// `then` where all bits of `mask` are set, `otherwise` where none is.
    #[inline(always)]
    unsafe fn chosen(mask: __m128, then: __m128, otherwise: __m128) -> __m128 {
        // SAFETY: SSE2
        unsafe { _mm_or_ps(_mm_and_ps(mask, then), _mm_andnot_ps(mask, otherwise)) }
    }

    /// AVX2 with fused multiply-add.
    impl Register for __m256 {
        intrinsics!(__m256, 8, 12, _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps _mm256_min_ps
            _mm256_max_ps _mm256_sqrt_ps _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps);
        #[inline(always)]
        fn neg(self) -> Self {
            // SAFETY: as the trait demands; so below
            unsafe { _mm256_xor_ps(self, _mm256_set1_ps(-0.0)) }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self) }
        }
        #[inline(always)]
        fn fused(self, factor: Self, addend: Self) -> Self {
            unsafe { _mm256_fmadd_ps(self, factor, addend) }
        }
        #[inline(always)]
        fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self {
            unsafe { _mm256_blendv_ps(otherwise, then, _mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) }
        }
        #[inline(always)]
        fn quarters(shifted: Self, sine: Self, cosine: Self) -> (Self, Self) {
            unsafe {
                let n = _mm256_castps_si256(shifted);
                let odd = _mm256_castsi256_ps(_mm256_slli_epi32::<31>(n));
                let two = _mm256_set1_epi32(2);
                let after = _mm256_add_epi32(n, _mm256_set1_epi32(1));
                let s = _mm256_castsi256_ps(_mm256_slli_epi32::<30>(_mm256_and_si256(n, two)));
                let c = _mm256_castsi256_ps(_mm256_slli_epi32::<30>(_mm256_and_si256(after, two)));
                (
                    _mm256_xor_ps(_mm256_blendv_ps(sine, cosine, odd), s),
                    _mm256_xor_ps(_mm256_blendv_ps(cosine, sine, odd), c),
                )
            }
        }
        #[inline(always)]
        fn power(n: Self) -> Self {
            unsafe {
                let n = _mm256_add_epi32(_mm256_cvttps_epi32(n), _mm256_set1_epi32(127));
                _mm256_castsi256_ps(_mm256_slli_epi32::<23>(n))
            }
        }
        #[inline(always)]
        fn sum(self) -> f32 {
            unsafe {
                _mm_add_ps(_mm256_castps256_ps128(self), _mm256_extractf128_ps::<1>(self)).sum()
            }
        }
    }

    /// AVX-512 (F).
    impl Register for __m512 {
        intrinsics!(__m512, 16, 16, _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps _mm512_min_ps
            _mm512_max_ps _mm512_sqrt_ps _mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps);
        #[inline(always)]
        fn neg(self) -> Self {
            // SAFETY: as the trait demands; so below
            unsafe {
                let sign = _mm512_set1_epi32(i32::MIN);
                _mm512_castsi512_ps(_mm512_xor_si512(_mm512_castps_si512(self), sign))
            }
        }
        #[inline(always)]
        fn abs(self) -> Self {
            unsafe { _mm512_abs_ps(self) }
        }
        #[inline(always)]
        fn fused(self, factor: Self, addend: Self) -> Self {
            unsafe { _mm512_fmadd_ps(self, factor, addend) }
        }
        #[inline(always)]
        fn where_less(a: Self, b: Self, then: Self, otherwise: Self) -> Self {
            unsafe { _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b), otherwise, then) }
        }
        #[inline(always)]
        fn quarters(shifted: Self, sine: Self, cosine: Self) -> (Self, Self) {
            unsafe {
                let n = _mm512_castps_si512(shifted);
                let odd = _mm512_test_epi32_mask(n, _mm512_set1_epi32(1));
                let two = _mm512_set1_epi32(2);
                let after = _mm512_add_epi32(n, _mm512_set1_epi32(1));
                let s = _mm512_castps_si512(_mm512_mask_blend_ps(odd, sine, cosine));
                let c = _mm512_castps_si512(_mm512_mask_blend_ps(odd, cosine, sine));
                let of_s = _mm512_slli_epi32::<30>(_mm512_and_si512(n, two));
                let of_c = _mm512_slli_epi32::<30>(_mm512_and_si512(after, two));
                (
                    _mm512_castsi512_ps(_mm512_xor_si512(s, of_s)),
                    _mm512_castsi512_ps(_mm512_xor_si512(c, of_c)),
                )
            }
        }
        #[inline(always)]
        fn power(n: Self) -> Self {
            unsafe {
                let n = _mm512_add_epi32(_mm512_cvttps_epi32(n), _mm512_set1_epi32(127));
                _mm512_castsi512_ps(_mm512_slli_epi32::<23>(n))
            }
        }
        #[inline(always)]
        fn sum(self) -> f32 {
            unsafe {
                let upper = _mm512_extractf64x4_pd::<1>(_mm512_castps_pd(self));
                _mm256_add_ps(_mm512_castps512_ps256(self), _mm256_castpd_ps(upper)).sum()
            }
        }
    }
}
