//! Four `f64` lanes in one AVX register.

use super::avx2::avx2;
use super::memory::{load_f32x8, load_f64x4, load_u32x8, store_f32x4, store_f64x4, store_u32x8};
use super::{Avx2, Avx8, DoubleLanes, Lanes4, Lanes8, WideLanes};
use std::arch::x86_64::*;

/// Four lanes in an AVX register.
#[derive(Clone, Copy, Debug)]
pub struct Avx4(__m256d);

impl DoubleLanes for Avx4 {
    const LANES: usize = 4;
    type Token = Avx2;

    #[inline(always)]
    fn token(self) -> Avx2 {
        // SAFETY: only the functions of this module make values of this type, all of them from a
        // token.
        unsafe { Avx2::assume() }
    }

    #[inline(always)]
    fn splat(token: Avx2, value: f64) -> Self {
        Self(avx2!(token, _mm256_set1_pd(value)))
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_add_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_sub_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_mul_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_div_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_min_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_max_pd(self.0, other.0)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(avx2!(self.token(), _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)))
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        avx2!(self.token(), _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0)) as u32)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        avx2!(self.token(), _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0)) as u32)
    }
}

impl Lanes4 for Avx4 {
    #[inline(always)]
    fn load(token: Avx2, values: &[f64; 4]) -> Self {
        Self(avx2!(token, load_f64x4(values)))
    }

    #[inline(always)]
    fn load_columns(token: Avx2, rows: [&[f64; 4]; 4]) -> [Self; 4] {
        avx2!(token, {
            let [a, b] = [load_f64x4(rows[0]), load_f64x4(rows[1])];
            let [c, d] = [load_f64x4(rows[2]), load_f64x4(rows[3])];
            let (even_ab, even_cd) = (_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d));
            let (odd_ab, odd_cd) = (_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d));
            [
                Self(_mm256_permute2f128_pd::<0x20>(even_ab, even_cd)),
                Self(_mm256_permute2f128_pd::<0x20>(odd_ab, odd_cd)),
                Self(_mm256_permute2f128_pd::<0x31>(even_ab, even_cd)),
                Self(_mm256_permute2f128_pd::<0x31>(odd_ab, odd_cd)),
            ]
        })
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 4]) {
        avx2!(self.token(), store_f64x4(self.0, to))
    }

    #[inline(always)]
    fn store_rounded(self, to: &mut [f32; 4]) {
        avx2!(self.token(), store_f32x4(_mm256_cvtpd_ps(self.0), to))
    }

    #[inline(always)]
    fn rounded(self) -> Self {
        Self(avx2!(self.token(), _mm256_cvtps_pd(_mm256_cvtpd_ps(self.0))))
    }

    #[inline(always)]
    fn fused(self, factor: Self, summand: Self) -> Self {
        Self(avx2!(self.token(), _mm256_fmadd_pd(self.0, factor.0, summand.0)))
    }

    #[inline(always)]
    fn negated(self) -> Self {
        Self(avx2!(self.token(), _mm256_xor_pd(_mm256_set1_pd(-0.0), self.0)))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(avx2!(self.token(), _mm256_sqrt_pd(self.0)))
    }

    #[inline(always)]
    fn replace(self, mask: u32, other: Self) -> Self {
        avx2!(self.token(), {
            let bits = _mm256_setr_epi64x(1, 2, 4, 8);
            let chosen =
                _mm256_cmpeq_epi64(_mm256_and_si256(_mm256_set1_epi64x(mask.into()), bits), bits);
            Self(_mm256_blendv_pd(self.0, other.0, _mm256_castsi256_pd(chosen)))
        })
    }
}

impl WideLanes for Avx8 {
    type Doubles = Avx4;

    #[inline(always)]
    fn with_tag(self, tag: u32) -> Self {
        avx2!(self.token(), {
            let high = _mm256_and_si256(_mm256_castps_si256(self.0), _mm256_set1_epi32(!31));
            Self(_mm256_castsi256_ps(_mm256_or_si256(high, _mm256_set1_epi32((tag & 31) as i32))))
        })
    }

    #[inline(always)]
    fn look_up(self, table: &[u32; 32], to: &mut [u32; 8]) {
        let (parts, _) = table.as_chunks::<8>();
        avx2!(self.token(), {
            // A permutation reads the lowest three bits of each lane, and a blend the highest bit.
            let tags = _mm256_castps_si256(self.0);
            let part = |i: usize| {
                _mm256_permutevar8x32_ps(_mm256_castsi256_ps(load_u32x8(&parts[i])), tags)
            };
            let fourth = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(tags));
            let fifth = _mm256_castsi256_ps(_mm256_slli_epi32::<27>(tags));
            let low = _mm256_blendv_ps(part(0), part(1), fourth);
            let high = _mm256_blendv_ps(part(2), part(3), fourth);
            store_u32x8(_mm256_castps_si256(_mm256_blendv_ps(low, high, fifth)), to);
        })
    }

    #[inline(always)]
    fn places_of(token: Avx2, value: u32, values: &[u32; 8]) -> u32 {
        avx2!(token, {
            let values = load_u32x8(values);
            let same = _mm256_cmpeq_epi32(values, _mm256_set1_epi32(value as i32));
            _mm256_movemask_ps(_mm256_castsi256_ps(same)) as u32
        })
    }

    #[inline(always)]
    fn load_columns(token: Avx2, rows: [&[f32; 8]; 8]) -> [Self; 8] {
        avx2!(token, {
            // Closures are avoided: they are compiled without the instructions, and vectors must
            // not pass through calls.
            let [r0, r1] = [load_f32x8(rows[0]), load_f32x8(rows[1])];
            let [r2, r3] = [load_f32x8(rows[2]), load_f32x8(rows[3])];
            let [r4, r5] = [load_f32x8(rows[4]), load_f32x8(rows[5])];
            let [r6, r7] = [load_f32x8(rows[6]), load_f32x8(rows[7])];
            // Transposes pairs of rows, then groups of four rows, in each half of the registers.
            let [a, b] = [_mm256_unpacklo_ps(r0, r1), _mm256_unpackhi_ps(r0, r1)];
            let [c, d] = [_mm256_unpacklo_ps(r2, r3), _mm256_unpackhi_ps(r2, r3)];
            let [e, f] = [_mm256_unpacklo_ps(r4, r5), _mm256_unpackhi_ps(r4, r5)];
            let [g, h] = [_mm256_unpacklo_ps(r6, r7), _mm256_unpackhi_ps(r6, r7)];
            const FRONT: i32 = 0b0100_0100;
            const BACK: i32 = 0b1110_1110;
            let [a0, a1] = [_mm256_shuffle_ps::<FRONT>(a, c), _mm256_shuffle_ps::<BACK>(a, c)];
            let [a2, a3] = [_mm256_shuffle_ps::<FRONT>(b, d), _mm256_shuffle_ps::<BACK>(b, d)];
            let [b0, b1] = [_mm256_shuffle_ps::<FRONT>(e, g), _mm256_shuffle_ps::<BACK>(e, g)];
            let [b2, b3] = [_mm256_shuffle_ps::<FRONT>(f, h), _mm256_shuffle_ps::<BACK>(f, h)];
            [
                Self(_mm256_permute2f128_ps::<0x20>(a0, b0)),
                Self(_mm256_permute2f128_ps::<0x20>(a1, b1)),
                Self(_mm256_permute2f128_ps::<0x20>(a2, b2)),
                Self(_mm256_permute2f128_ps::<0x20>(a3, b3)),
                Self(_mm256_permute2f128_ps::<0x31>(a0, b0)),
                Self(_mm256_permute2f128_ps::<0x31>(a1, b1)),
                Self(_mm256_permute2f128_ps::<0x31>(a2, b2)),
                Self(_mm256_permute2f128_ps::<0x31>(a3, b3)),
            ]
        })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(avx2!(self.token(), _mm256_div_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        avx2!(self.token(), {
            let four =
                _mm_min_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_min_ss(two, _mm_shuffle_ps::<1>(two, two)))
        })
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        avx2!(self.token(), {
            let four =
                _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_max_ss(two, _mm_shuffle_ps::<1>(two, two)))
        })
    }

    #[inline(always)]
    fn first_doubles(self) -> Avx4 {
        Avx4(avx2!(self.token(), _mm256_cvtps_pd(_mm256_castps256_ps128(self.0))))
    }

    #[inline(always)]
    fn last_doubles(self) -> Avx4 {
        Avx4(avx2!(self.token(), _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(self.0))))
    }

    #[inline(always)]
    fn from_doubles(first: Avx4, last: Avx4) -> Self {
        Self(avx2!(
            first.token(),
            _mm256_set_m128(_mm256_cvtpd_ps(last.0), _mm256_cvtpd_ps(first.0))
        ))
    }
}
