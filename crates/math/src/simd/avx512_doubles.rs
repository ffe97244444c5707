//! `f64` lanes in AVX-512 registers: sixteen in two, eight in one.

use super::avx512::avx512;
use super::memory::{load_f64x8, load_u32x8, store_f32x8, store_f64x8};
use super::{Avx8, Avx16, Avx512, DoubleLanes, Doubles16, DoublesOf, Lanes16};
use std::arch::x86_64::*;

/// Sixteen lanes in two registers.
#[derive(Clone, Copy, Debug)]
pub struct Avx16Doubles([__m512d; 2]);

impl Doubles16 for Avx16Doubles {
    type Token = Avx512;
    type Singles = Avx16;

    #[inline(always)]
    fn token(self) -> Avx512 {
        // SAFETY: only the functions of this module make values of this type, all of them from a
        // token.
        unsafe { Avx512::assume() }
    }

    #[inline(always)]
    fn splat(token: Avx512, value: f64) -> Self {
        Self([avx512!(token, _mm512_set1_pd(value)); 2])
    }

    #[inline(always)]
    fn load(token: Avx512, values: &[f64; 16]) -> Self {
        let (eights, _) = values.as_chunks::<8>();
        Self(avx512!(token, [load_f64x8(&eights[0]), load_f64x8(&eights[1])]))
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 16]) {
        let (eights, _) = to.as_chunks_mut::<8>();
        avx512!(self.token(), {
            store_f64x8(self.0[0], &mut eights[0]);
            store_f64x8(self.0[1], &mut eights[1]);
        })
    }

    #[inline(always)]
    fn of(singles: Avx16) -> Self {
        let [low, high] = singles.halves();
        Self(avx512!(singles.token(), [_mm512_cvtps_pd(low.0), _mm512_cvtps_pd(high.0)]))
    }

    #[inline(always)]
    fn rounded(self) -> Avx16 {
        let [low, high] = self.0;
        avx512!(
            self.token(),
            Avx16::from_halves(
                self.token(),
                Avx8(_mm512_cvtpd_ps(low)),
                Avx8(_mm512_cvtpd_ps(high))
            )
        )
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, other.0);
        Self(avx512!(self.token(), [_mm512_add_pd(a, c), _mm512_add_pd(b, d)]))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, other.0);
        Self(avx512!(self.token(), [_mm512_sub_pd(a, c), _mm512_sub_pd(b, d)]))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, other.0);
        Self(avx512!(self.token(), [_mm512_mul_pd(a, c), _mm512_mul_pd(b, d)]))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, other.0);
        Self(avx512!(self.token(), [_mm512_div_pd(a, c), _mm512_div_pd(b, d)]))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, summand: Self) -> Self {
        let ([a, b], [c, d], [e, f]) = (self.0, factor.0, summand.0);
        Self(avx512!(self.token(), [_mm512_fmadd_pd(a, c, e), _mm512_fmadd_pd(b, d, f)]))
    }

    #[inline(always)]
    fn fused(self, factor: Self, summand: Self) -> Self {
        self.mul_add(factor, summand)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        let [a, b] = self.0;
        Self(avx512!(self.token(), [_mm512_abs_pd(a), _mm512_abs_pd(b)]))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let [a, b] = self.0;
        Self(avx512!(self.token(), [_mm512_sqrt_pd(a), _mm512_sqrt_pd(b)]))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        let ([a, b], [c, d]) = (self.0, other.0);
        let (low, high) = avx512!(
            self.token(),
            (_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, c), _mm512_cmp_pd_mask::<_CMP_LT_OQ>(b, d))
        );
        u32::from(low) | u32::from(high) << 8
    }

    #[inline(always)]
    fn replace(self, mask: u32, other: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, other.0);
        Self(avx512!(
            self.token(),
            [_mm512_mask_blend_pd(mask as u8, a, c), _mm512_mask_blend_pd((mask >> 8) as u8, b, d)]
        ))
    }
}

/// Eight lanes in one register.
#[derive(Clone, Copy, Debug)]
pub struct Avx8Doubles(__m512d);

impl DoubleLanes for Avx8Doubles {
    const LANES: usize = 8;
    type Token = Avx512;

    #[inline(always)]
    fn token(self) -> Avx512 {
        // SAFETY: only the functions of this module make values of this type, all of them from a
        // token.
        unsafe { Avx512::assume() }
    }

    #[inline(always)]
    fn splat(token: Avx512, value: f64) -> Self {
        Self(avx512!(token, _mm512_set1_pd(value)))
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_add_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_sub_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_mul_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_div_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_min_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(avx512!(self.token(), _mm512_max_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(avx512!(self.token(), _mm512_abs_pd(self.0)))
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        avx512!(self.token(), _mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, other.0).into())
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        avx512!(self.token(), _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0).into())
    }
}

impl DoublesOf<Avx8> for Avx8Doubles {
    #[inline(always)]
    fn of(token: Avx512, singles: Avx8, _first: usize) -> Self {
        Self(avx512!(token, _mm512_cvtps_pd(singles.0)))
    }

    #[inline(always)]
    fn gather(token: Avx512, values: &[f64; 16], lanes: &[u32; 8], _first: usize) -> Self {
        let (eights, _) = values.as_chunks::<8>();
        avx512!(token, {
            let lanes = _mm512_cvtepu32_epi64(load_u32x8(lanes));
            let [low, high] = [load_f64x8(&eights[0]), load_f64x8(&eights[1])];
            Self(_mm512_permutex2var_pd(low, lanes, high))
        })
    }

    #[inline(always)]
    fn store_rounded_from(self, to: &mut [f32; 8], _first: usize) {
        avx512!(self.token(), store_f32x8(_mm512_cvtpd_ps(self.0), to))
    }
}
