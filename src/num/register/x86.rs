//! The operations of [`Register`] with the vector instructions of x86-64 processors: SSE2, AVX2 and AVX-512.

use std::arch::x86_64::*;

use super::Register;

/// SSE2, which every x86-64 processor has.
impl Register for __m128 {
    intrinsics!(__m128, 4, 12, _mm_add_ps _mm_sub_ps _mm_mul_ps _mm_div_ps _mm_min_ps _mm_max_ps
        _mm_sqrt_ps _mm_set1_ps _mm_loadu_ps _mm_storeu_ps);
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: as the trait requires, the processor has the instructions. This is also true of the methods below.
        unsafe { _mm_xor_ps(self, _mm_set1_ps(-0.0)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        unsafe { _mm_andnot_ps(_mm_set1_ps(-0.0), self) }
    }
    /// Calls a library function for each lane, because SSE2 has no fused multiply-add.
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

/// Selects `then` where all bits of `mask` are set, and `otherwise` where none are.
#[inline(always)]
unsafe fn chosen(mask: __m128, then: __m128, otherwise: __m128) -> __m128 {
    // SAFETY: every x86-64 processor has SSE2
    unsafe { _mm_or_ps(_mm_and_ps(mask, then), _mm_andnot_ps(mask, otherwise)) }
}

/// AVX2 with fused multiply-add.
impl Register for __m256 {
    intrinsics!(__m256, 8, 12, _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps _mm256_min_ps
        _mm256_max_ps _mm256_sqrt_ps _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps);
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: as the trait requires, the processor has the instructions. This is also true of the methods below.
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
        unsafe { _mm_add_ps(_mm256_castps256_ps128(self), _mm256_extractf128_ps::<1>(self)).sum() }
    }
}

/// The AVX-512 Foundation instructions (AVX-512F).
impl Register for __m512 {
    intrinsics!(__m512, 16, 16, _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps _mm512_min_ps
        _mm512_max_ps _mm512_sqrt_ps _mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps);
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: as the trait requires, the processor has the instructions. This is also true of the methods below.
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
