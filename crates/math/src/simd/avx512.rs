//! Sixteen lanes in one AVX-512 register.

use super::memory::{
    load_f32x16, load_u32x8, load_u32x16, store_f32x16, store_f32x16_where, store_u32x16_where,
};
use super::{Avx2, Avx8, Avx8Doubles, Avx16Doubles, Avx512, Lanes8, Lanes16, WideLanes};
use std::arch::x86_64::*;

/// `avx512!(token, expression)`: evaluates AVX-512 intrinsics, where a token proves that the
/// machine has these instructions. The rules of [`avx2`](super::avx2::avx2) apply.
macro_rules! avx512 {
    ($token:expr, $instructions:expr) => {{
        let _: $crate::simd::Avx512 = $token;
        // SAFETY: the token proves that the machine has AVX-512 F, VL, BW and DQ, which is all that
        // these intrinsics require.
        unsafe { $instructions }
    }};
}
pub(super) use avx512;

/// Sixteen lanes in an AVX-512 register.
#[derive(Clone, Copy, Debug)]
pub struct Avx16(pub(super) __m512);

impl Lanes16 for Avx16 {
    const REGISTERS: u32 = 1;
    type Token = Avx512;
    type Half = Avx8;
    type Doubles = Avx16Doubles;
    type HalfDoubles = Avx8Doubles;

    #[inline(always)]
    fn token(self) -> Avx512 {
        // SAFETY: only the functions of this module make values of this type, all of them from a
        // token.
        unsafe { Avx512::assume() }
    }

    #[inline(always)]
    fn half_token(token: Avx512) -> Avx2 {
        token.into()
    }

    #[inline(always)]
    fn splat(token: Avx512, value: f32) -> Self {
        Self(avx512!(token, _mm512_set1_ps(value)))
    }

    #[inline(always)]
    fn load(token: Avx512, values: &[f32; 16]) -> Self {
        Self(avx512!(token, load_f32x16(values)))
    }

    #[inline(always)]
    fn load_halves(token: Avx512, low: &[f32; 8], high: &[f32; 8]) -> Self {
        Self::from_halves(token, Avx8::load(token.into(), low), Avx8::load(token.into(), high))
    }

    #[inline(always)]
    fn gather(token: Avx512, values: &[f32; 16], lanes: &[u32; 8]) -> Avx8 {
        avx512!(token, {
            let lanes = _mm512_castsi256_si512(load_u32x8(lanes));
            Avx8(_mm512_castps512_ps256(_mm512_permutexvar_ps(lanes, load_f32x16(values))))
        })
    }

    #[inline(always)]
    fn from_halves(token: Avx512, low: Avx8, high: Avx8) -> Self {
        Self(avx512!(token, _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low.0), high.0)))
    }

    #[inline(always)]
    fn halves(self) -> [Avx8; 2] {
        avx512!(
            self.token(),
            [Avx8(_mm512_castps512_ps256(self.0)), Avx8(_mm512_extractf32x8_ps::<1>(self.0))]
        )
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 16]) {
        avx512!(self.token(), store_f32x16(self.0, to))
    }

    #[inline(always)]
    fn store_where(self, mask: u32, to: &mut [f32; 16]) {
        avx512!(self.token(), store_f32x16_where(self.0, mask as u16, to))
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_add_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_sub_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_mul_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_div_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        Self(avx512!(self.token(), _mm512_fmadd_ps(self.0, factor.0, summand.0)))
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self {
        Self(avx512!(self.token(), _mm512_fmsub_ps(self.0, factor.0, subtrahend.0)))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_min_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(avx512!(self.token(), _mm512_abs_ps(self.0)))
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        avx512!(self.token(), _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0).into())
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        avx512!(self.token(), _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0).into())
    }

    #[inline(always)]
    fn signs(self) -> u32 {
        avx512!(self.token(), _mm512_movepi32_mask(_mm512_castps_si512(self.0)).into())
    }

    #[inline(always)]
    fn replace(self, mask: u32, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_mask_blend_ps(mask as u16, self.0, other.0)))
    }

    #[inline(always)]
    fn where_less(self, low: Self, high: Self, other: Self) -> Self {
        Self(avx512!(
            self.token(),
            _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(low.0, high.0), self.0, other.0)
        ))
    }

    #[inline(always)]
    fn with_tag(self, tag: u32) -> Self {
        avx512!(self.token(), {
            let high = _mm512_and_epi32(_mm512_castps_si512(self.0), _mm512_set1_epi32(!31));
            Self(_mm512_castsi512_ps(_mm512_or_epi32(high, _mm512_set1_epi32((tag & 31) as i32))))
        })
    }

    #[inline(always)]
    fn write_where(token: Avx512, mask: u32, value: u32, to: &mut [u32; 16]) {
        avx512!(token, store_u32x16_where(_mm512_set1_epi32(value as i32), mask as u16, to))
    }

    #[inline(always)]
    fn places_of(token: Avx512, value: u32, values: &[u32; 16]) -> u32 {
        avx512!(token, {
            let values = load_u32x16(values);
            _mm512_cmpeq_epi32_mask(values, _mm512_set1_epi32(value as i32)).into()
        })
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
