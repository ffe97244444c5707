//! Eight lanes in one AVX register.

use super::Lanes8;
use std::arch::x86_64::*;

/// Eight lanes of AVX. A value exists only where `splat` or `load` was allowed to make it, so its operations are safe to call.
/// Callers carry `#[target_feature(enable = "avx2")]`; everything here is inlined into them.
#[derive(Clone, Copy, Debug)]
pub struct Avx8(__m256);

impl Lanes8 for Avx8 {
    #[inline(always)]
    unsafe fn splat(value: f32) -> Self {
        // SAFETY: the caller guarantees AVX.
        Self(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    unsafe fn load(values: &[f32; 8]) -> Self {
        // SAFETY: the caller guarantees AVX; the reference covers 32 readable bytes.
        Self(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        // SAFETY: a value of this type exists, so the machine has AVX; the reference covers 32 writable bytes.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_mul_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: a value of this type exists, so the machine has AVX.
        Self(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        // SAFETY: a value of this type exists, so the machine has AVX.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u32 }
    }

    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        // SAFETY: a value of this type exists, so the machine has AVX.
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
    }

    #[inline(always)]
    fn compress_le(
        self,
        limit: Self,
        order: u32,
        payload: &[u32; 8],
        values_out: &mut [f32; 8],
        payload_out: &mut [u32; 8],
    ) -> usize {
        // SAFETY: a value of this type exists, and whoever made it promised AVX2; the references cover 32 bytes each, and a mask
        // of eight lanes is below 256.
        unsafe {
            let shifts = _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21);
            // The permutation reads only the lowest three bits of each lane.
            let order = _mm256_srlv_epi32(_mm256_set1_epi32(order as i32), shifts);
            let kept = _mm256_permutevar8x32_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, limit.0), order);
            let mask = _mm256_movemask_ps(kept) as usize;
            let front = _mm_loadl_epi64(FRONT.get_unchecked(mask).as_ptr().cast());
            let order = _mm256_permutevar8x32_epi32(order, _mm256_cvtepu8_epi32(front));
            let payload = _mm256_loadu_si256(payload.as_ptr().cast());
            _mm256_storeu_ps(values_out.as_mut_ptr(), _mm256_permutevar8x32_ps(self.0, order));
            _mm256_storeu_si256(payload_out.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(payload, order));
            mask.count_ones() as usize
        }
    }
}

/// For each mask of eight lanes the numbers of the lanes that are set, in order.
static FRONT: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask][count] = lane as u8;
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::super::{Lanes8, Level, Portable8};
    use super::Avx8;

    fn run<L: Lanes8>(a: &[f32; 8], b: &[f32; 8]) -> (Vec<[u32; 8]>, [u32; 2], Vec<(u32, u32)>) {
        // SAFETY: the test has checked the level.
        let (x, y) = unsafe { (L::load(a), L::load(b)) };
        let values = [x.add(y), x.sub(y), x.mul(y), x.min(y), x.max(y), x.abs()];
        let bits = values.map(|v| {
            let mut out = [0.0; 8];
            v.store(&mut out);
            out.map(|f| if f.is_nan() { u32::MAX } else { f.to_bits() })
        });
        let order = [5u32, 0, 7, 2, 6, 1, 4, 3].iter().rev().fold(0, |o, lane| (o << 3) | lane);
        let (mut values, mut payload) = ([0.0; 8], [0; 8]);
        let kept = x.compress_le(y, order, &[10, 11, 12, 13, 14, 15, 16, 17], &mut values, &mut payload);
        let compressed = values.iter().zip(payload).take(kept).map(|(v, p)| (v.to_bits(), p)).collect();
        (bits.to_vec(), [x.le(y), x.lt(y)], compressed)
    }

    #[test]
    fn avx_lanes_give_the_bits_of_the_portable_ones() {
        if !Level::Avx2.is_supported() {
            eprintln!("skipped: no AVX2");
            return;
        }
        let special =
            [0.0, -0.0, 1.0, -1.5, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1e-45, 3e38, f32::MIN_POSITIVE];
        for i in 0..special.len() * special.len() {
            let a = std::array::from_fn(|k| special[(i + k) % special.len()]);
            let b = std::array::from_fn(|k| special[(i / special.len() + 3 * k) % special.len()]);
            assert_eq!(run::<Avx8>(&a, &b), run::<Portable8>(&a, &b), "{a:?} {b:?}");
        }
    }
}
