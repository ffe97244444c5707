//! Sixteen lanes in one AVX-512 register.

use super::{Avx8, Avx8Doubles, Avx16Doubles, Lanes8, Lanes16, WideLanes};
use std::arch::x86_64::*;

/// Sixteen lanes of AVX-512. As [`Avx8`]: a value exists only where it was allowed to make one.
/// Callers carry `#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq")]` and what
/// [`Avx8`] asks for.
#[derive(Clone, Copy, Debug)]
pub struct Avx16(pub(super) __m512);

impl Lanes16 for Avx16 {
    const REGISTERS: u32 = 1;
    type Half = Avx8;
    type Doubles = Avx16Doubles;
    type HalfDoubles = Avx8Doubles;

    #[inline(always)]
    unsafe fn splat(value: f32) -> Self {
        // SAFETY: the caller guarantees AVX-512.
        Self(unsafe { _mm512_set1_ps(value) })
    }

    #[inline(always)]
    unsafe fn load(values: &[f32; 16]) -> Self {
        // SAFETY: the caller guarantees AVX-512; the reference covers 64 readable bytes.
        Self(unsafe { _mm512_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    unsafe fn load_halves(low: &[f32; 8], high: &[f32; 8]) -> Self {
        // SAFETY: the caller guarantees AVX-512; the references cover 32 readable bytes each.
        unsafe {
            Self::from_halves(
                Avx8(_mm256_loadu_ps(low.as_ptr())),
                Avx8(_mm256_loadu_ps(high.as_ptr())),
            )
        }
    }

    #[inline(always)]
    unsafe fn gather(values: &[f32; 16], lanes: &[u32; 8]) -> Avx8 {
        // SAFETY: the caller guarantees AVX-512; the references cover 64 and 32 readable bytes. The
        // lowest four bits of each lane are read.
        unsafe {
            let lanes = _mm512_castsi256_si512(_mm256_loadu_si256(lanes.as_ptr().cast()));
            Avx8(_mm512_castps512_ps256(_mm512_permutexvar_ps(
                lanes,
                _mm512_loadu_ps(values.as_ptr()),
            )))
        }
    }

    #[inline(always)]
    unsafe fn from_halves(low: Avx8, high: Avx8) -> Self {
        // SAFETY: the caller guarantees AVX-512.
        Self(unsafe { _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low.0), high.0) })
    }

    #[inline(always)]
    fn halves(self) -> [Avx8; 2] {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        unsafe { [Avx8(_mm512_castps512_ps256(self.0)), Avx8(_mm512_extractf32x8_ps::<1>(self.0))] }
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 16]) {
        // SAFETY: a value of this type exists, so the machine has AVX-512; the reference covers 64
        // writable bytes.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn store_where(self, mask: u32, to: &mut [f32; 16]) {
        // SAFETY: a value of this type exists, so the machine has AVX-512; the reference covers 64
        // writable bytes.
        unsafe { _mm512_mask_storeu_ps(to.as_mut_ptr(), mask as u16, self.0) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_mul_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_div_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, summand.0) })
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_fmsub_ps(self.0, factor.0, subtrahend.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_abs_ps(self.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0).into() }
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0).into() }
    }

    #[inline(always)]
    fn signs(self) -> u32 {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        unsafe { _mm512_movepi32_mask(_mm512_castps_si512(self.0)).into() }
    }

    #[inline(always)]
    fn replace(self, mask: u32, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe { _mm512_mask_blend_ps(mask as u16, self.0, other.0) })
    }

    #[inline(always)]
    fn where_less(self, low: Self, high: Self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        Self(unsafe {
            _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(low.0, high.0), self.0, other.0)
        })
    }

    #[inline(always)]
    fn with_tag(self, tag: u32) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX-512.
        unsafe {
            let high = _mm512_and_epi32(_mm512_castps_si512(self.0), _mm512_set1_epi32(!31));
            Self(_mm512_castsi512_ps(_mm512_or_epi32(high, _mm512_set1_epi32((tag & 31) as i32))))
        }
    }

    #[inline(always)]
    unsafe fn write_where(mask: u32, value: u32, to: &mut [u32; 16]) {
        // SAFETY: the caller guarantees AVX-512; the reference covers 64 writable bytes.
        unsafe {
            _mm512_mask_storeu_epi32(
                to.as_mut_ptr().cast(),
                mask as u16,
                _mm512_set1_epi32(value as i32),
            )
        }
    }

    #[inline(always)]
    unsafe fn places_of(value: u32, values: &[u32; 16]) -> u32 {
        // SAFETY: the caller guarantees AVX-512; the reference covers 64 readable bytes.
        unsafe {
            let values = _mm512_loadu_epi32(values.as_ptr().cast());
            _mm512_cmpeq_epi32_mask(values, _mm512_set1_epi32(value as i32)).into()
        }
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        let [low, high] = self.halves();
        Lanes8::min(low, high).reduce_min()
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        let [low, high] = self.halves();
        Lanes8::max(low, high).reduce_max()
    }
}
